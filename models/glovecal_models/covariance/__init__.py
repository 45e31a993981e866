"""Covariance functions of the calibration models; they compose with ``+``."""
