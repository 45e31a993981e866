"""Live poses of a model whose kernels were chosen: what a recorded take gets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from effect_models import HYSTERESIS
from loop_by_hand import LoopByHand, as_take, assert_published, moving_frames
from realtime_support import LAYOUT

from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.regression.kernel_scores import kernel_of
from glovecal_models.takes.take import Take


def test_a_stream_gives_what_the_recorded_take_gives_whatever_the_kernel() -> None:
    """One rotation each: LMC-GPR, a polynomial, two squared exponentials; an effect on top of them."""
    random = np.random.default_rng(0)
    readings = random.uniform(20.0, 230.0, (120, 3))
    share = readings / 250
    angle = np.column_stack([90 * share[:, 0] ** 2, 80 * share[:, 1] ** 3, 60 * share[:, 2] * share[:, 0]])
    time_s = np.arange(120) / 10
    take = Take(
        "t",
        "w",
        LAYOUT.sensors,
        time_s,
        readings,
        LAYOUT.rotations,
        time_s,
        angle + random.normal(size=angle.shape),
    )
    wanted = ("lmc_gpr", "polynomial_3", "general")
    settings = TrainingSettings("auto", folds=0, kernels=tuple(zip(LAYOUT.rotations, wanted, strict=True)))
    model = train([take], LAYOUT, "anna", settings)
    assert tuple(kernel_of(item.regressor) for item in model.rotations) == wanted
    model = replace(
        model, effects=(HYSTERESIS,), sensor_centre=np.full(3, 120.0), sensor_scale=np.full(3, 50.0)
    )
    frames = moving_frames(200)
    by_hand = LoopByHand.serving(model)
    by_hand.say("g1")
    by_hand.stream(frames, together=5)
    assert_published(by_hand.poses["g1"], as_take(model, frames))
