"""Live poses with a stated delay: those of the take estimated so, each frame once, and others untouched."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from effect_models import FAULT, HYSTERESIS, MODEL, model_with
from loop_by_hand import LoopByHand, as_take, assert_published, moving_frames

from glovecal_client.wire.frame import Frame
from glovecal_client.wire.pose import Pose
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.offline import LEAD, OfflinePredictor
from glovecal_models.calibration.predictor import GloveAngles
from glovecal_service.realtime import delayed_poses
from glovecal_service.realtime.frame_record import FrameRecord
from glovecal_service.realtime.lane_effects import GloveContext

DELAY_MS = 60


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a slow machine frames of a test come late; they are no silence."""
    monkeypatch.setattr(delayed_poses, "NO_FRAME_NS", 600 * 10**9)


def led(model: CalibrationModel) -> CalibrationModel:
    """With a lag that has learned how smoothed readings are led."""
    lead = {"offset_deg": 0.3, "gain": 1.01, "velocity_s": 0.05, "acceleration_s2": 0.001, "variance": 0.2}
    return replace(
        model,
        effects=tuple(
            replace(item, settings=item.settings | {LEAD: dict.fromkeys(item.rotations, lead)})
            if item.name == "lag"
            else item
            for item in model.effects
        ),
    )


def delayed_take(model: CalibrationModel, frames: list[Frame], delay_ms: int = DELAY_MS) -> GloveAngles:
    time_s = np.array([frame.monotonic_ns for frame in frames]) / 1e9
    readings = np.array([frame.readings for frame in frames], dtype=np.float64)
    return OfflinePredictor(model).predict_delayed(time_s, readings, {}, "w", [delay_ms / 1000])[0]


def choose(by_hand: LoopByHand, glove: str, delay_ms: int) -> None:
    run = f"{1:016x}"
    by_hand.worn.put(glove, GloveContext(run, "w", delay_ns=10**6 * delay_ms))


def with_a_gap(frames: list[Frame], pause_s: float = 10.0) -> list[Frame]:
    half = len(frames) // 2
    later = [
        replace(frame, monotonic_ns=frame.monotonic_ns + round(1e9 * pause_s)) for frame in frames[half:]
    ]
    return frames[:half] + later


def assert_is_take(poses: list[Pose], frames: list[Frame], expected: GloveAngles) -> None:
    assert [pose.sequence for pose in poses] == [frame.sequence for frame in frames]
    assert [pose.monotonic_ns for pose in poses] == [frame.monotonic_ns for frame in frames]
    assert_published(poses, expected.mean)
    sd = np.array([pose.deviations for pose in poses])
    np.testing.assert_allclose(sd, expected.sd, rtol=1e-5)


@pytest.mark.parametrize("model", [led(MODEL), model_with(HYSTERESIS, FAULT), model_with()])
def test_a_delayed_stream_gives_what_the_take_gives_with_that_delay(model: CalibrationModel) -> None:
    frames = with_a_gap(moving_frames(500))
    by_hand = LoopByHand.serving(model)
    choose(by_hand, "g1", DELAY_MS)
    by_hand.stream(frames, together=3)
    waiting = by_hand.status("g1")["waiting"]
    assert 3 <= waiting <= 12
    poses, expected = by_hand.poses["g1"], delayed_take(model, frames)
    sent = len(frames) - waiting
    known = GloveAngles(expected.mean[:sent], expected.sd[:sent], expected.flags[:sent])
    assert_is_take(poses, frames[:sent], known)
    live = as_take(model, frames)
    assert np.abs(expected.mean - live).max() > 0.5
    assert np.abs(np.diff(expected.mean, n=2, axis=0)).mean() < np.abs(np.diff(live, n=2, axis=0)).mean()


def test_a_glove_beside_it_is_served_as_ever() -> None:
    by_hand = LoopByHand.serving(led(MODEL))
    by_hand.models.put("g2", by_hand.models.of("g1"))
    choose(by_hand, "g1", DELAY_MS)
    one, two = moving_frames(200, seed=1), moving_frames(200, seed=2, run_id=2)
    by_hand.send([item for pair in zip(one, two, strict=True) for item in (("g1", pair[0]), ("g2", pair[1]))])
    assert_published(by_hand.poses["g2"], as_take(led(MODEL), two))
    assert len(by_hand.poses["g1"]) < 200 == len(by_hand.poses["g2"])


def test_each_frame_becomes_one_pose_in_order_whatever_is_chosen_meanwhile() -> None:
    frames = moving_frames(300)
    by_hand = LoopByHand.serving(MODEL)
    for start, delay_ms in ((0, 60), (50, 0), (100, 200), (150, 50), (250, 0)):
        choose(by_hand, "g1", delay_ms)
        by_hand.stream(frames[start : start + 50])
        if start == 150:
            by_hand.serve("g1", model_with(), number=2)
            by_hand.stream(frames[200:230])
            by_hand.models.put("g1", None)
            by_hand.stream(frames[230:250])
            by_hand.serve("g1", MODEL, number=1)
    poses = by_hand.poses["g1"]
    assert [pose.sequence for pose in poses] == list(range(300))
    status = by_hand.status("g1")
    assert (status["predicted"], status["waiting"], status["skipped"]) == (300, 0, 0)
    models = {pose.sequence: pose.model_sha256 for pose in poses}
    assert len(set(models.values())) == 3
    assert len({models[number] for number in range(200)}) == 1


def test_poses_that_wait_go_out_where_no_frame_comes_any_more(monkeypatch: pytest.MonkeyPatch) -> None:
    frames = moving_frames(100)
    by_hand = LoopByHand.serving(MODEL)
    choose(by_hand, "g1", 500)
    by_hand.stream(frames)
    assert 40 <= by_hand.status("g1")["waiting"] <= 60
    monkeypatch.setattr(delayed_poses, "NO_FRAME_NS", -(10**12))
    monkeypatch.setattr(by_hand.loop, "_looked_for_stale_ns", 0)
    by_hand.loop.step()
    assert_is_take(by_hand.poses["g1"], frames, delayed_take(MODEL, frames, 500))
    assert by_hand.status("g1")["waiting"] == 0


def test_terms_of_a_delayed_glove_are_those_of_a_frame_by_itself() -> None:
    frames, record = moving_frames(30), FrameRecord()
    by_hand = LoopByHand.serving(MODEL)
    choose(by_hand, "g1", DELAY_MS)
    by_hand.stream(frames[:20])
    [lane] = by_hand.loop.lanes
    lane.record = record
    by_hand.stream(frames[20:21])
    assert record.is_served.is_set()
    assert lane.record is None
    found = record.explanation()
    total = [sum(term.degrees for term in item.terms) for item in found.rotations]
    np.testing.assert_allclose(total, as_take(MODEL, frames[:21])[-1], atol=1e-9)
