"""Adding an effect to a calibration: learned with the rest, verified on held-out takes, or undone."""
