"""Whole-glove calibration models: training, prediction, artifact, comparison with measurements."""
