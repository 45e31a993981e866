"""The loop: an effect is added, verified on held-out takes, or undone, until nothing more helps."""
