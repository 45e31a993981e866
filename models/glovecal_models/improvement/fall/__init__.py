"""How the error falls from no calibration through every effect that was added."""
