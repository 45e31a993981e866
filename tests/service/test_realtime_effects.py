"""Live poses with effects: what a recorded take gets, each glove with a state of its own, and its resets."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from effect_models import CREEP, HYSTERESIS, LAG, UNITS, LoopByHand, added, model_with, moving_frames
from realtime_support import LAYOUT

from glovecal_client.wire.frame import Frame, encode_frame
from glovecal_client.wire.pose import Pose, RotationFlag
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.effects.expression_effect import ExpressionEffect
from glovecal_models.errors import BadInput
from glovecal_service.realtime.frame_gate import TAKEOVER_AFTER_NS
from glovecal_service.realtime.lane_effects import LaneEffects
from glovecal_service.realtime.recording_file import RecordingFile
from glovecal_service.realtime.recording_take import read_take
from glovecal_service.realtime.served_model import ServedModel
from glovecal_service.realtime.worn_gloves import WornGlove

MODEL = model_with(HYSTERESIS, CREEP, LAG)
SETTLING_S = 2.5


def as_take(model: CalibrationModel, frames: list[Frame], wearing: str = "w") -> np.ndarray:
    """Degrees (N, R) of the frames predicted as a recorded take."""
    time_s = np.array([frame.monotonic_ns for frame in frames]) / 1e9
    readings = np.array([frame.readings for frame in frames], dtype=np.float64)
    return GlovePredictor(model).predict_take(time_s, readings, {}, wearing).mean


def degrees(poses: list[Pose]) -> np.ndarray:
    return np.array([pose.degrees for pose in poses])


def assert_published(poses: list[Pose], expected: np.ndarray) -> None:
    """To the last bit but one of what a pose can hold."""
    np.testing.assert_array_max_ulp(degrees(poses), expected.astype(np.float32), 1)


def test_a_stream_gives_what_the_recorded_take_gives() -> None:
    frames = moving_frames(400)
    late = [
        replace(frame, sequence=400 + frame.sequence, monotonic_ns=frame.monotonic_ns + 10**10)
        for frame in frames
    ]
    base = GlovePredictor(MODEL).predict(np.array([frame.readings for frame in frames]))
    by_hand = LoopByHand()
    by_hand.serve("g1", MODEL)
    by_hand.say("g1")
    by_hand.send([("g1", frame) for frame in frames + late], together=7)
    expected = as_take(MODEL, frames + late)
    assert_published(by_hand.poses["g1"], expected)
    assert np.abs(expected[:400] - base.mean).max() > 1.0
    assert by_hand.status("g1")["skipped"] == 0


def test_before_it_is_rounded_for_the_wire_it_agrees_to_1e_9() -> None:
    frames, served = moving_frames(300), ServedModel.prepare("1" * 64, MODEL)
    effects, found = LaneEffects(served), []
    for frame in frames:
        base = served.predict([frame.readings])
        correction = effects.correct(frame, WornGlove(), base.mean[0]).degrees
        found.append(served.predictor.corrected(base, correction[None]).mean[0])
    np.testing.assert_allclose(found, as_take(MODEL, frames), rtol=0, atol=1e-9)


def test_two_gloves_on_one_model_have_states_of_their_own() -> None:
    by_hand = LoopByHand()
    by_hand.serve("g1", MODEL)
    by_hand.models.put("g2", by_hand.models.of("g1"))
    one, two = moving_frames(200, seed=1), moving_frames(200, seed=2, run_id=2)
    by_hand.send([item for pair in zip(one, two, strict=True) for item in (("g1", pair[0]), ("g2", pair[1]))])
    assert_published(by_hand.poses["g1"], as_take(MODEL, one))
    assert_published(by_hand.poses["g2"], as_take(MODEL, two))


def test_a_restarted_service_begins_anew() -> None:
    frames = moving_frames(120)
    for part in (frames[:70], frames[70:]):
        by_hand = LoopByHand()
        by_hand.serve("g1", MODEL)
        by_hand.send([("g1", frame) for frame in part])
        assert_published(by_hand.poses["g1"], as_take(MODEL, part))
        assert [pose.sequence for pose in by_hand.poses["g1"] if pose.state_reset] == [part[0].sequence]


def test_skipped_frames_are_a_hole_in_the_take() -> None:
    frames = [frame for frame in moving_frames(300) if frame.sequence % 7 < 4]
    by_hand = LoopByHand()
    by_hand.serve("g1", MODEL)
    by_hand.send([("g1", frame) for frame in frames])
    assert_published(by_hand.poses["g1"], as_take(MODEL, frames))


def test_a_pose_says_when_its_effects_begin_anew_and_when_they_have_settled() -> None:
    frames = moving_frames(600)
    gap = [
        replace(frame, sequence=600 + frame.sequence, monotonic_ns=frame.monotonic_ns + 10**10)
        for frame in frames[:20]
    ]
    by_hand = LoopByHand()
    by_hand.serve("g1", MODEL)
    by_hand.send([("g1", frame) for frame in frames + gap])
    poses = by_hand.poses["g1"]
    assert [pose.sequence for pose in poses if pose.state_reset] == [0, 600]
    start_ns = frames[0].monotonic_ns
    young = [frame.sequence for frame in frames if frame.monotonic_ns - start_ns < SETTLING_S * 1e9]
    assert [pose.sequence for pose in poses if pose.settling] == young + [f.sequence for f in gap]
    assert by_hand.status("g1")["effects"]["starts"] == 2


def test_a_model_without_memory_never_settles() -> None:
    shift = added("donning_shift", (), (3.0, 0.0), settings={"wearings": ["w"], **UNITS})
    by_hand = LoopByHand()
    by_hand.serve("g1", model_with(shift))
    by_hand.say("g1")
    by_hand.send([("g1", frame) for frame in moving_frames(20)])
    assert not any(pose.settling or pose.state_reset for pose in by_hand.poses["g1"])


def test_a_new_run_and_another_model_begin_anew() -> None:
    first, second = moving_frames(150), moving_frames(150, run_id=2, start_s=1001.0)
    by_hand = LoopByHand()
    by_hand.serve("g1", MODEL)
    by_hand.send([("g1", frame) for frame in first])
    time.sleep(1.1 * TAKEOVER_AFTER_NS / 1e9)
    by_hand.poses.clear()
    by_hand.send([("g1", frame) for frame in second[:80]])
    by_hand.serve("g1", model_with(LAG, HYSTERESIS), number=2)
    by_hand.send([("g1", frame) for frame in second[80:]])
    poses = [pose for pose in by_hand.poses["g1"] if not pose.stale]
    assert_published(poses[:80], as_take(MODEL, second[:80]))
    assert_published(poses[80:], as_take(model_with(LAG, HYSTERESIS), second[80:]))
    assert [pose.sequence for pose in poses if pose.state_reset] == [0, 80]


def test_a_new_wearing_begins_anew_but_the_name_may_come_late() -> None:
    frames = moving_frames(90)
    by_hand = LoopByHand()
    by_hand.serve("g1", MODEL)
    by_hand.send([("g1", frame) for frame in frames[:30]])
    by_hand.say("g1", wearing="monday")
    by_hand.send([("g1", frame) for frame in frames[30:60]])
    by_hand.say("g1", wearing="tuesday")
    by_hand.send([("g1", frame) for frame in frames[60:]])
    assert [pose.sequence for pose in by_hand.poses["g1"] if pose.state_reset] == [0, 60]
    assert_published(by_hand.poses["g1"][60:], as_take(MODEL, frames[60:]))


def test_the_wearing_of_an_earlier_run_is_not_that_of_a_new_one() -> None:
    shift = added("donning_shift", (), (3.0, 0.0), settings={"wearings": ["monday"], **UNITS})
    model, frames = model_with(shift), moving_frames(4, run_id=7)
    by_hand = LoopByHand()
    by_hand.serve("g1", model)
    by_hand.say("g1", run_id=6, wearing="monday")
    by_hand.send([("g1", frame) for frame in frames[:2]])
    assert by_hand.status("g1")["effects"]["sentences"] == [
        "nobody said which wearing this is: donning_shift is not corrected"
    ]
    by_hand.say("g1", run_id=7, wearing="monday")
    by_hand.send([("g1", frame) for frame in frames[2:]])
    assert by_hand.status("g1")["effects"]["sentences"] == []
    base = as_take(model, frames, "?")
    np.testing.assert_allclose(
        degrees(by_hand.poses["g1"]) - base, [[0.0] * 3] * 2 + [[3.0] * 3] * 2, atol=1e-4
    )


def test_context_goes_with_the_frame_and_what_is_not_sent_is_said() -> None:
    warm = added(
        "warmup_drift", (100.0,), (10.0, 0.0), settings={"low": 0.0, "high": 900.0, "usual": 900.0, **UNITS}
    )
    model, frames = model_with(warm), moving_frames(3)
    by_hand = LoopByHand()
    by_hand.serve("g1", model)
    by_hand.say("g1", context=("supply_v",))
    by_hand.send([("g1", replace(frames[0], context=np.array([4.9], np.float32)))])
    assert by_hand.status("g1")["effects"]["sentences"] == [
        "context power_on_s is not sent: warmup_drift is not corrected"
    ]
    by_hand.say("g1", context=("supply_v", "power_on_s"))
    for frame, seconds in zip(frames[1:], (0.0, np.nan), strict=True):
        by_hand.send([("g1", replace(frame, context=np.array([4.9, seconds], np.float32)))])
    correction = (
        degrees(by_hand.poses["g1"])
        - GlovePredictor(model).predict(np.array([frame.readings for frame in frames])).mean
    )
    unknown = 10.0 * np.exp(-9.0)
    np.testing.assert_allclose(correction[:, 0], [unknown, 10.0, unknown], atol=1e-4)
    assert by_hand.status("g1")["effects"]["sentences"]


@pytest.mark.parametrize("columns", ["1e300 * exp(t * 100)", "400 + 0 * own"])
def test_an_absurd_correction_leaves_the_base_flagged_and_counted(columns: str) -> None:
    document = ExpressionEffect.parse(f"name = wild; columns = {columns}").declaration.to_document()
    wild = added("wild", (), (1.0,), ("I_PIP",), settings={"declaration": document, "context": {}, **UNITS})
    model, frames = model_with(HYSTERESIS, wild), moving_frames(50)
    by_hand = LoopByHand()
    by_hand.serve("g1", model)
    by_hand.send([("g1", frame) for frame in frames])
    base = GlovePredictor(model).predict(np.array([frame.readings for frame in frames])).mean
    poses = by_hand.poses["g1"]
    np.testing.assert_allclose(degrees(poses)[:, 1], base[:, 1], rtol=1e-6)
    assert all(pose.too_uncertain for pose in poses)
    assert all(pose.rotation_flags[1] & RotationFlag.TOO_UNCERTAIN for pose in poses)
    assert not any(pose.rotation_flags[0] & RotationFlag.TOO_UNCERTAIN for pose in poses)
    assert by_hand.status("g1")["effects"]["unusable_corrections"] == 50


def test_an_effect_that_raises_does_not_stop_the_poses(monkeypatch: pytest.MonkeyPatch) -> None:
    by_hand = LoopByHand()
    by_hand.serve("g1", MODEL)
    served = by_hand.models.of("g1")
    assert served is not None
    stream = served.predictor.stream()

    def broken(*_: object) -> np.ndarray:
        raise RuntimeError("somebody else's code")

    monkeypatch.setattr(stream, "of_frame", broken)
    monkeypatch.setattr(served.predictor, "stream", lambda: stream)
    frames = moving_frames(5)
    by_hand.send([("g1", frame) for frame in frames])
    base = GlovePredictor(MODEL).predict(np.array([frame.readings for frame in frames])).mean
    assert_published(by_hand.poses["g1"], base)
    assert all(pose.too_uncertain for pose in by_hand.poses["g1"])
    monkeypatch.undo()
    more = [replace(frame, sequence=frame.sequence + 5) for frame in moving_frames(30, start_s=1000.2)]
    by_hand.send([("g1", frame) for frame in more])
    assert_published(by_hand.poses["g1"][5:], as_take(MODEL, more))


def test_a_model_whose_effect_is_not_here_or_another_is_refused_before_it_is_served() -> None:
    with pytest.raises(BadInput, match="no effect 'strap'"):
        ServedModel.prepare("1" * 64, model_with(replace(HYSTERESIS, name="strap")))
    older = replace(HYSTERESIS, weights=HYSTERESIS.weights[:, :2])
    with pytest.raises(BadInput, match="learned with 1 parameters and 2 weights, but here it has 1 and 3"):
        ServedModel.prepare("1" * 64, model_with(older))


def test_a_declared_effect_without_a_value_is_left_out_and_flagged() -> None:
    text = "name = strap; columns = 1 / c.strap_n, lowpass(own_deg, tau) - own_deg; parameter tau s 0.1 5 = 1"
    declared = ExpressionEffect.parse(text).declaration.to_document()
    span = {"strap_n": {"low": 0.0, "high": 9.0, "usual": 1.0}}
    strap = added(
        "strap", (1.0,), (1.0, 0.3), ("I_PIP",), settings={"declaration": declared, "context": span, **UNITS}
    )
    model, frames = model_with(HYSTERESIS, strap), moving_frames(60)
    tension = np.where(np.arange(60) % 5 == 0, 0.0, 2.0).astype(np.float32)
    by_hand = LoopByHand()
    by_hand.serve("g1", model)
    by_hand.say("g1", context=("strap_n",))
    sent = [replace(frame, context=tension[at : at + 1]) for at, frame in enumerate(frames)]
    by_hand.send([("g1", frame) for frame in sent])
    time_s = np.array([frame.monotonic_ns for frame in frames]) / 1e9
    readings = np.array([frame.readings for frame in frames], dtype=np.float64)
    context = {"strap_n": tension.astype(np.float64)}
    assert_published(
        by_hand.poses["g1"], GlovePredictor(model).predict_take(time_s, readings, context, "w").mean
    )
    doubtful = [bool(pose.rotation_flags[1] & RotationFlag.TOO_UNCERTAIN) for pose in by_hand.poses["g1"]]
    assert doubtful == (tension == 0).tolist()
    assert by_hand.status("g1")["effects"]["unusable_corrections"] == 12


def test_a_recording_read_back_gives_what_was_live(tmp_path: Path) -> None:
    frames = moving_frames(200)
    meta = {"capture": {"sensors": list(LAYOUT.sensors), "context": []}}
    file = RecordingFile.create(tmp_path / "r.glog", meta)
    for frame in frames:
        file.add(frame, encode_frame(frame))
    file.close()
    take = read_take(tmp_path / "r.glog", name="r", wearing="w").take
    by_hand = LoopByHand()
    by_hand.serve("g1", MODEL)
    by_hand.say("g1")
    by_hand.send([("g1", frame) for frame in frames])
    replayed = GlovePredictor(MODEL).predict_take(take.time_s, take.readings, take.context, take.wearing)
    assert_published(by_hand.poses["g1"], replayed.mean)
