"""Calibration models of a whole glove: training, with effects or without, artifact, prediction."""
