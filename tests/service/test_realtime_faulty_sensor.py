"""A sensor that fails live: the pose says so, keeps the last good angle and claims less with every frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from effect_models import CREEP, FAULT, FAULT_LIMITS, HYSTERESIS, added, model_with
from loop_by_hand import LoopByHand, moving_frames, served_in_turns
from realtime_support import LAYOUT

from glovecal_client.wire.frame import Frame
from glovecal_client.wire.pose import PoseFlag, RotationFlag
from glovecal_models.calibration.predictor import FAULTY_SENSOR, GloveAngles, GlovePredictor

WALK = {"rate_deg_per_sqrt_min": 6.0}
SLIP = added("garment_slip", (), (), settings={"rotations": dict.fromkeys(LAYOUT.rotations, WALK)})
MODEL = model_with(HYSTERESIS, CREEP, SLIP, FAULT)
DROPPED = slice(150, 160)


def failing_frames() -> list[Frame]:
    """The first sensor falls to zero for ten frames."""
    frames = moving_frames(300)
    for number in range(DROPPED.start, DROPPED.stop):
        readings = frames[number].readings.copy()
        readings[0] = 0.0
        frames[number] = replace(frames[number], readings=readings)
    return frames


def as_take(frames: list[Frame]) -> GloveAngles:
    time_s = np.array([frame.monotonic_ns for frame in frames]) / 1e9
    readings = np.array([frame.readings for frame in frames], dtype=np.float64)
    return GlovePredictor(MODEL).predict_take(time_s, readings, {}, "w")


def test_the_stream_is_the_take_to_1e_9() -> None:
    """Beside a glove of the same model that is sound."""
    frames, sound = failing_frames(), moving_frames(300, run_id=2)
    turns = ([("g1", one), ("g2", two)] for one, two in zip(frames, sound, strict=True))
    found = served_in_turns(MODEL, turns)
    for glove, of_glove in (("g1", frames), ("g2", sound)):
        expected = as_take(of_glove)
        for name in ("mean", "sd", "flags"):
            served = getattr(found[glove], name)
            np.testing.assert_allclose(served, getattr(expected, name), rtol=0, atol=1e-9)


def test_the_last_good_angle_is_kept_flagged_and_counted() -> None:
    frames, by_hand = failing_frames(), LoopByHand()
    by_hand.serve("g1", MODEL)
    by_hand.say("g1")
    by_hand.send([("g1", frame) for frame in frames[: DROPPED.stop]])
    assert any("sensor" in said and "fails" in said for said in by_hand.status("g1")["effects"]["sentences"])
    by_hand.send([("g1", frame) for frame in frames[DROPPED.stop :]])
    poses = by_hand.poses["g1"]
    served = np.array([pose.sequence for pose in poses])  # a busy computer may have skipped some
    fails = (served >= DROPPED.start) & (served < DROPPED.stop)
    row = next(i for i, read in enumerate(FAULT_LIMITS.reads) if read == (LAYOUT.sensors[0],))
    flagged = np.array([bool(pose.rotation_flags[row] & RotationFlag.FAULTY_SENSOR) for pose in poses])
    np.testing.assert_array_equal(flagged, fails)
    assert [bool(pose.flags & PoseFlag.FAULTY_SENSOR) for pose in poses] == fails.tolist()
    sound = as_take(moving_frames(300)).mean[:, row]
    kept = np.array([pose.degrees[row] for pose in poses])
    assert np.abs(kept[fails] - sound[DROPPED.start - 1]).max() < 5.0, "not where a reading of zero would be"
    spread = np.array([pose.deviations[row] for pose in poses])
    assert (np.diff(spread[fails]) > 0).all()
    assert spread[served >= DROPPED.stop][0] < spread[fails][0]
    status = by_hand.status("g1")["effects"]
    assert status["faulty_frames"] == {LAYOUT.sensors[0]: int(fails.sum())}
    assert not any("fails" in said for said in status["sentences"])


def test_a_slip_makes_the_claim_grow_from_the_start_of_a_wearing() -> None:
    frames = moving_frames(400)
    later = [
        replace(frame, sequence=400 + frame.sequence, monotonic_ns=frame.monotonic_ns + 60 * 10**9)
        for frame in frames
    ]
    angles = as_take(frames + later)
    assert angles.sd[400:].mean() == pytest.approx(np.hypot(angles.sd[:400].mean(), 6.0), rel=0.1)
    assert not (angles.flags & FAULTY_SENSOR).any()
    by_hand = LoopByHand()
    by_hand.serve("g1", MODEL)
    by_hand.say("g1", wearing="one")
    by_hand.send([("g1", frame) for frame in frames])
    by_hand.say("g1", wearing="two")
    by_hand.send([("g1", frame) for frame in later])
    poses = by_hand.poses["g1"]
    before, after = poses[0].deviations, next(pose for pose in poses if pose.sequence >= 400).deviations
    np.testing.assert_allclose(after, before, rtol=0.01)
