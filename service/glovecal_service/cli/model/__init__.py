"""Calibration models: train, show, compare, check and activate them."""
