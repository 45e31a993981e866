"""Live poses with effects: what a recorded take gets, each glove with a state of its own, and its resets."""

from __future__ import annotations

import itertools
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from effect_models import HYSTERESIS, LAG, MODEL, UNITS, added, model_with
from loop_by_hand import (
    LoopByHand,
    as_take,
    assert_published,
    degrees,
    moving_frames,
    served_in_turns,
)
from realtime_support import LAYOUT

from glovecal_client.wire.frame import encode_frame
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.errors import BadInput
from glovecal_service.incoming.frame_gate import TAKEOVER_AFTER_NS
from glovecal_service.recorder.recording_result import read_take
from glovecal_service.recorder.run_ledger import RunLedger

SETTLING_S = 2.5


def test_a_stream_gives_what_the_recorded_take_gives() -> None:
    frames = moving_frames(400)
    late = [
        replace(frame, sequence=400 + frame.sequence, monotonic_ns=frame.monotonic_ns + 10**10)
        for frame in frames
    ]
    base = GlovePredictor(MODEL).predict(np.array([frame.readings for frame in frames]))
    by_hand = LoopByHand.serving(MODEL)
    by_hand.say("g1")
    by_hand.stream(frames + late, together=7)
    expected = as_take(MODEL, frames + late)
    assert_published(by_hand.poses["g1"], expected)
    assert np.abs(expected[:400] - base.mean).max() > 1.0
    assert by_hand.status("g1")["skipped"] == 0


def test_sensors_in_another_order_are_read_by_their_names() -> None:
    """Effects that look at other sensors too: the same numbers, whatever the order of the columns."""
    coupled = added(
        "cross_coupling", (), (0.2, 0.1), ("I_PIP",), settings={"neighbours": ["M_MCP", "I_MCP"], **UNITS}
    )
    model = replace(model_with(HYSTERESIS, coupled), sensor_centre=np.array([100.0, 120.0, 140.0]))
    readings = np.random.default_rng(3).uniform(30.0, 220.0, (200, 3))
    time_s = np.arange(200) / 100.0
    order = [2, 0, 1]
    other = model.with_sensor_order([LAYOUT.sensors[column] for column in order])
    found = GlovePredictor(model).predict_take(time_s, readings, {}, "w")
    again = GlovePredictor(other).predict_take(time_s, readings[:, order], {}, "w")
    np.testing.assert_allclose(again.mean, found.mean, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(again.flags, found.flags)
    assert not np.allclose(found.mean, GlovePredictor(model_with()).predict(readings).mean)
    with pytest.raises(BadInput, match="cannot be put in the order"):
        model.with_sensor_order(["I_MCP", "I_PIP", "T_IP"])


def test_before_it_is_rounded_for_the_wire_it_agrees_to_1e_9() -> None:
    frames = moving_frames(300)
    found = served_in_turns(MODEL, ([("g1", frame)] for frame in frames))["g1"]
    np.testing.assert_allclose(found.mean, as_take(MODEL, frames), rtol=0, atol=1e-9)


def test_gloves_in_one_turn_get_what_each_would_get_alone() -> None:
    """One to twelve frames a turn of five gloves, several of one glove among them, one with a gap of 2 s."""
    frames = {f"g{number}": moving_frames(120, seed=number, run_id=number) for number in range(5)}
    frames["g3"][60:] = [
        replace(frame, monotonic_ns=frame.monotonic_ns + 2 * 10**9) for frame in frames["g3"][60:]
    ]
    random = np.random.default_rng(3)
    waiting = [glove for glove, of_glove in frames.items() for _ in of_glove]
    random.shuffle(waiting)
    next_of = {glove: iter(of_glove) for glove, of_glove in frames.items()}
    order = [(glove, next(next_of[glove])) for glove in waiting]
    edges = np.cumsum(random.integers(1, 13, len(order)))
    turns = [turn for turn in (order[a:b] for a, b in itertools.pairwise([0, *edges])) if turn]
    found = served_in_turns(MODEL, turns)
    for glove, of_glove in frames.items():
        np.testing.assert_allclose(found[glove].mean, as_take(MODEL, of_glove), rtol=0, atol=1e-9)


def test_gloves_with_different_models_get_what_the_takes_give() -> None:
    models = {"g1": MODEL, "g2": model_with(LAG, HYSTERESIS), "g3": MODEL, "g4": model_with()}
    by_hand, frames = LoopByHand(), {}
    for number, (glove, model) in enumerate(models.items()):
        by_hand.serve(glove, model, number=number + 1)
        frames[glove] = moving_frames(150, seed=number, run_id=number + 1)
    by_hand.models.put("g3", by_hand.models.of("g1"))
    by_hand.send([(glove, frames[glove][at]) for at in range(150) for glove in models], together=17)
    for glove, model in models.items():
        assert_published(by_hand.poses[glove], as_take(model, frames[glove]))


def test_two_gloves_on_one_model_have_states_of_their_own() -> None:
    by_hand = LoopByHand.serving(MODEL)
    by_hand.models.put("g2", by_hand.models.of("g1"))
    one, two = moving_frames(200, seed=1), moving_frames(200, seed=2, run_id=2)
    by_hand.send([item for pair in zip(one, two, strict=True) for item in (("g1", pair[0]), ("g2", pair[1]))])
    assert_published(by_hand.poses["g1"], as_take(MODEL, one))
    assert_published(by_hand.poses["g2"], as_take(MODEL, two))


def test_a_restarted_service_begins_anew() -> None:
    frames = moving_frames(120)
    for part in (frames[:70], frames[70:]):
        by_hand = LoopByHand.serving(MODEL)
        by_hand.stream(part)
        assert_published(by_hand.poses["g1"], as_take(MODEL, part))
        assert [pose.sequence for pose in by_hand.poses["g1"] if pose.state_reset] == [part[0].sequence]


def test_skipped_frames_are_a_hole_in_the_take() -> None:
    frames = [frame for frame in moving_frames(300) if frame.sequence % 7 < 4]
    by_hand = LoopByHand.serving(MODEL)
    by_hand.stream(frames)
    assert_published(by_hand.poses["g1"], as_take(MODEL, frames))


def test_a_pose_says_when_its_effects_begin_anew_and_when_they_have_settled() -> None:
    frames = moving_frames(600)
    gap = [
        replace(frame, sequence=600 + frame.sequence, monotonic_ns=frame.monotonic_ns + 10**10)
        for frame in frames[:20]
    ]
    by_hand = LoopByHand.serving(MODEL)
    by_hand.stream(frames + gap)
    poses = by_hand.poses["g1"]
    assert [pose.sequence for pose in poses if pose.state_reset] == [0, 600]
    start_ns = frames[0].monotonic_ns
    young = [frame.sequence for frame in frames if frame.monotonic_ns - start_ns < SETTLING_S * 1e9]
    assert [pose.sequence for pose in poses if pose.settling] == young + [f.sequence for f in gap]
    assert by_hand.status("g1")["effects"]["starts"] == 2


def test_a_model_without_memory_never_settles() -> None:
    shift = added("donning_shift", (), (3.0, 0.0), settings={"wearings": ["w"], **UNITS})
    by_hand = LoopByHand.serving(model_with(shift))
    by_hand.say("g1")
    by_hand.stream(moving_frames(20))
    assert not any(pose.settling or pose.state_reset for pose in by_hand.poses["g1"])


def test_a_new_run_and_another_model_begin_anew() -> None:
    first, second = moving_frames(150), moving_frames(150, run_id=2, start_s=1001.0)
    by_hand = LoopByHand.serving(MODEL)
    by_hand.stream(first)
    time.sleep(1.1 * TAKEOVER_AFTER_NS / 1e9)
    by_hand.poses.clear()
    by_hand.stream(second[:80])
    by_hand.serve("g1", model_with(LAG, HYSTERESIS), number=2)
    by_hand.stream(second[80:])
    poses = by_hand.poses["g1"]
    assert_published(poses[:80], as_take(MODEL, second[:80]))
    assert_published(poses[80:], as_take(model_with(LAG, HYSTERESIS), second[80:]))
    assert [pose.sequence for pose in poses if pose.state_reset] == [0, 80]


def test_a_new_wearing_begins_anew_but_the_name_may_come_late() -> None:
    frames = moving_frames(90)
    by_hand = LoopByHand.serving(MODEL)
    by_hand.stream(frames[:30])
    by_hand.say("g1", wearing="monday")
    by_hand.stream(frames[30:60])
    by_hand.say("g1", wearing="tuesday")
    by_hand.stream(frames[60:])
    assert [pose.sequence for pose in by_hand.poses["g1"] if pose.state_reset] == [0, 60]
    assert_published(by_hand.poses["g1"][60:], as_take(MODEL, frames[60:]))


def test_the_wearing_of_an_earlier_run_is_not_that_of_a_new_one() -> None:
    shift = added("donning_shift", (), (3.0, 0.0), settings={"wearings": ["monday"], **UNITS})
    model, frames = model_with(shift), moving_frames(4, run_id=7)
    by_hand = LoopByHand.serving(model)
    by_hand.say("g1", run_id=6, wearing="monday")
    by_hand.stream(frames[:2])
    assert by_hand.status("g1")["effects"]["sentences"] == [
        "nobody said which wearing this is: donning_shift is not corrected"
    ]
    by_hand.say("g1", run_id=7, wearing="monday")
    by_hand.stream(frames[2:])
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
    by_hand = LoopByHand.serving(model)
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


def test_a_recording_read_back_gives_what_was_live(tmp_path: Path) -> None:
    frames = moving_frames(200)
    meta = {"capture": {"sensors": list(LAYOUT.sensors), "context": []}}
    file = RunLedger.create(tmp_path / "r.glog", meta)
    for frame in frames:
        file.add(frame, encode_frame(frame))
    file.close()
    take = read_take(tmp_path / "r.glog", name="r", wearing="w").take
    by_hand = LoopByHand.serving(MODEL)
    by_hand.say("g1")
    by_hand.stream(frames)
    replayed = GlovePredictor(MODEL).predict_take(take.time_s, take.readings, take.context, take.wearing)
    assert_published(by_hand.poses["g1"], replayed.mean)
