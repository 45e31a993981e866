"""Calibration models: train, show, predict, compare, check: ``/v1/models``."""
