"""How a glove of the study is calibrated."""

from __future__ import annotations

from blind_glove import BlindGlove

from glovecal_models.calibration.training_settings import TrainingSettings

SAMPLES = 300
"""Representative frames: joints of one sensor reach the floor with so many, in seconds."""


def training_settings(glove: BlindGlove, folds: int = 3) -> TrainingSettings:
    return TrainingSettings("linear" if glove.linear else "lmc_gpr", samples=SAMPLES, folds=folds)
