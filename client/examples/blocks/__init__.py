"""Blocks on a desk: the physics, the script of a hand that builds a pyramid, and the picture."""
