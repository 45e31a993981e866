"""A model trained without a dead sensor serves the glove, which goes on sending it."""

from __future__ import annotations

import numpy as np
from loop_by_hand import LoopByHand, as_take, assert_published, moving_frames
from realtime_support import LAYOUT

from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.takes.take import Take


def test_live_poses_come_without_the_dead_sensor():
    readings = np.round(np.random.default_rng(0).uniform(20.0, 230.0, (200, 3)))
    reference = 0.5 * (readings - 100.0)
    readings[:, LAYOUT.sensors.index("I_MCP")] = 121.0
    time_s = np.arange(200) / 100.0
    take = Take("t", "w", LAYOUT.sensors, time_s, readings, LAYOUT.rotations, time_s, reference)
    model = train([take], LAYOUT, "anna", TrainingSettings(method="lmc_gpr", folds=0))
    assert [item.rotation for item in model.rotations] == ["I_PIP", "M_MCP"]
    assert model.rotations[1].correspondence.sensors == ("M_MCP",)
    frames = moving_frames(50)
    by_hand = LoopByHand.serving(model)
    by_hand.say("g1")
    by_hand.stream(frames, together=5)
    assert_published(by_hand.poses["g1"], as_take(model, frames))
