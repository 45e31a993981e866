"""Live poses of a wearing that a quick check learned, and the wider interval of one that nobody checked."""

from __future__ import annotations

import numpy as np
from loop_by_hand import LoopByHand, assert_published, moving_frames
from realtime_support import LAYOUT, linear_model

from glovecal_models.calibration.predictor import GloveAngles, GlovePredictor
from glovecal_models.quick_check.quick_check import quick_check
from glovecal_models.takes.take import Take

SHIFT = np.array([12.0, -9.0, 0.0])
"""Readings by which the new wearing reads more."""
PARENT = linear_model("anna", degrees_per_count=0.5)


def poses_of_tuesday() -> Take:
    """Three poses of 1 s each, their angles as the model predicts them without the shift."""
    held = np.repeat(np.array([[60.0, 70.0, 80.0], [180.0, 90.0, 190.0], [120.0, 190.0, 120.0]]), 50, axis=0)
    angles = GlovePredictor(PARENT).predict(held).mean
    time = np.arange(len(held)) / 50.0
    poses = tuple(name for name in ("flat", "fist", "spread") for _ in range(50))
    return Take("check", "tuesday", LAYOUT.sensors, time, held + SHIFT, LAYOUT.rotations, time, angles,
                poses=poses)  # fmt: skip


def as_take(readings: np.ndarray, wearing: str) -> GloveAngles:
    time_s = np.arange(len(readings)) / 100.0
    return GlovePredictor(CHECKED).predict_take(time_s, readings, {}, wearing)


CHECKED = quick_check(PARENT, [poses_of_tuesday()]).model


def test_the_checked_wearing_is_served_with_its_shift() -> None:
    frames = moving_frames(60)
    readings = np.array([frame.readings for frame in frames], dtype=np.float64)
    by_hand = LoopByHand()
    by_hand.serve("g1", CHECKED)
    by_hand.say("g1", wearing="tuesday")
    by_hand.send([("g1", frame) for frame in frames])
    expected = as_take(readings, "tuesday")
    assert_published(by_hand.poses["g1"], expected.mean)
    sd = np.array([pose.deviations for pose in by_hand.poses["g1"]])
    np.testing.assert_allclose(sd, expected.sd, rtol=1e-6)
    truth = GlovePredictor(PARENT).predict(readings - SHIFT).mean
    before = GlovePredictor(PARENT).predict(readings).mean
    assert np.abs(expected.mean - truth).max() < 0.25 * np.abs(before - truth).max()
    assert by_hand.status("g1")["effects"]["sentences"] == []


def test_a_wearing_that_nobody_checked_says_how_little_is_known() -> None:
    frames = moving_frames(20)
    readings = np.array([frame.readings for frame in frames], dtype=np.float64)
    by_hand = LoopByHand()
    by_hand.serve("g1", CHECKED)
    by_hand.say("g1", wearing="wednesday")
    by_hand.send([("g1", frame) for frame in frames])
    sd = np.array([pose.deviations for pose in by_hand.poses["g1"]])
    np.testing.assert_allclose(sd, as_take(readings, "wednesday").sd, rtol=1e-6)
    assert (sd > 1.5 * as_take(readings, "tuesday").sd).all()
    assert_published(by_hand.poses["g1"], GlovePredictor(PARENT).predict(readings).mean)
    [sentence] = by_hand.status("g1")["effects"]["sentences"]
    assert sentence == "wearing 'wednesday' was not in training: donning_shift is not corrected"
