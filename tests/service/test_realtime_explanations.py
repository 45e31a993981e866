"""A live pose is explained by the prediction that made it: its terms add up to what was served."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
import zenoh
from effect_models import CREEP, FAULT, HYSTERESIS, LAG, model_with
from loop_by_hand import LoopByHand, moving_frames
from realtime_support import LAYOUT, WireGlove, eventually, free_endpoint, part_of_service

from glovecal_client.errors import QueryRefused
from glovecal_client.keys import GloveKeys
from glovecal_client.session import ask, ask_json, open_client
from glovecal_client.wire.frame import Frame
from glovecal_client.wire.pose import Pose, decode_pose
from glovecal_models.calibration.answer import FrameExplanation
from glovecal_models.calibration.artifact import dump
from glovecal_service.realtime.frame_record import FrameRecord
from glovecal_service.realtime.live_explanations import QUERIES_WAITING, LiveExplanations
from glovecal_service.serve import real_time
from glovecal_service.settings import Settings
from glovecal_service.store import Store

MODEL = model_with(HYSTERESIS, CREEP, LAG, FAULT)
DROPPED = range(150, 160)


def frames_with_a_fault() -> list[Frame]:
    frames = moving_frames(200)
    for number in DROPPED:
        readings = frames[number].readings.copy()
        readings[0] = 0.0
        frames[number] = replace(frames[number], readings=readings)
    return frames


def explained(by_hand: LoopByHand, glove: str, frames: list[tuple[str, Frame]]) -> FrameRecord:
    """The record of the last frame of ``glove`` among ``frames``, which wait together."""
    lane = next(lane for lane in by_hand.loop.lanes if lane.glove == glove)
    record = lane.record = FrameRecord()
    by_hand.send(frames, together=len(frames))
    assert record.is_served.is_set()
    assert lane.record is None, "one frame only is written down"
    return record


def assert_is_the_pose(found: FrameExplanation, pose: Pose) -> None:
    for at, angle in enumerate(found.rotations):
        assert abs(sum(term.degrees for term in angle.terms) - angle.degrees) < 1e-9
        assert np.float32(angle.degrees) == pose.degrees[at]
        assert np.float32(angle.sd_deg) == pose.deviations[at]
        assert angle.flags == pose.rotation_flags[at]


def test_terms_add_up_to_the_pose_of_that_frame_beside_another_glove() -> None:
    by_hand = LoopByHand.serving(MODEL)
    by_hand.models.put("g2", by_hand.models.of("g1"))
    one, two = frames_with_a_fault(), moving_frames(200, seed=5, run_id=2)
    by_hand.send([("g1", one[0]), ("g2", two[0])])
    for number in range(1, 200, 3):
        both = [(glove, frame) for at in range(number, min(number + 3, 200))
                for glove, frame in (("g1", one[at]), ("g2", two[at]))]  # fmt: skip
        record = explained(by_hand, "g1", both)
        pose = by_hand.poses["g1"][-1]
        assert record.frame is not None
        assert record.frame.sequence == pose.sequence == both[-1][1].sequence
        assert_is_the_pose(record.explanation(), pose)


def test_a_model_without_effects_has_its_base_alone() -> None:
    by_hand, frames = LoopByHand.serving(model_with()), moving_frames(3)
    by_hand.stream(frames[:1])
    found = explained(by_hand, "g1", [("g1", frame) for frame in frames[1:]]).explanation()
    assert_is_the_pose(found, by_hand.poses["g1"][-1])
    assert [term.name for term in found.rotations[0].terms] == ["base", "measurement noise"]
    assert found.transient_s is None


def test_what_cannot_be_explained_is_said() -> None:
    """A held angle, and memories that have not settled."""
    by_hand, frames = LoopByHand.serving(MODEL), frames_with_a_fault()
    by_hand.stream(frames[: DROPPED[5]])
    found = explained(by_hand, "g1", [("g1", frames[DROPPED[5]])]).explanation()
    held = next(angle for angle in found.rotations if any(term.kind == "held" for term in angle.terms))
    assert any(said.startswith("Held:") for said in held.sentences)
    assert [said.split(":")[0] for said in found.sentences] == ["Transient", "Faulty sensor"]


def test_a_frame_that_became_no_pose_is_not_explained() -> None:
    by_hand, frames = LoopByHand.serving(MODEL), moving_frames(3)
    by_hand.stream(frames[:1])
    lane = by_hand.loop.lanes[0]
    lane.record = FrameRecord()
    by_hand.stream([replace(frames[1], readings=frames[1].readings[:2])])
    assert not lane.record.is_served.is_set()
    assert_is_the_pose(explained(by_hand, "g1", [("g1", frames[2])]).explanation(), by_hand.poses["g1"][-1])


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Settings:
    return Settings(data=tmp_path_factory.mktemp("explained"), zenoh=free_endpoint())


@pytest.fixture(scope="module")
def session(settings: Settings) -> Iterator[zenoh.Session]:
    with Store.open(settings) as store:
        store.layouts.put(LAYOUT)
        store.subjects.create("anna")
        record = store.models.add(
            dump(MODEL), subject="anna", layout=LAYOUT.name, method="linear", parent=None, facts={}
        )
        store.models.activate(record.id)
    with part_of_service(real_time, settings), open_client([settings.zenoh], wait_s=20) as session:
        yield session


@contextmanager
def sending(glove: WireGlove) -> Iterator[None]:
    stopped = threading.Event()

    def send() -> None:
        at = 0
        while not stopped.wait(0.01):
            if at % 50 == 0:
                glove.say_meta()
            glove.send((120.0 + 40.0 * np.sin(at / 20.0), 130.0, 140.0))
            at += 1

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield
    finally:
        stopped.set()
        thread.join()


def test_a_query_explains_the_pose_that_was_published(session: zenoh.Session, settings: Settings) -> None:
    poses: dict[int, Pose] = {}
    keys = GloveKeys(settings.site, "asked")

    def hear(sample: zenoh.Sample) -> None:
        pose = decode_pose(sample.payload.to_bytes())
        poses[pose.sequence] = pose

    with session.declare_subscriber(keys.pose, zenoh.handlers.Callback(hear, indirect=False)):
        with pytest.raises(QueryRefused, match="no frame of glove asked has arrived"):
            ask(session, keys.pose_explain)
        with sending(WireGlove(session, settings, "asked", subject="anna")):
            eventually(lambda: any(len(pose.degrees) for pose in poses.values()), "it is calibrated")
            found = ask_json(session, f"{keys.pose_explain}?rotations=I_PIP")
            everything = ask_json(session, keys.pose_explain)
            with pytest.raises(QueryRefused, match="no rotation 'X_Y'"):
                ask(session, f"{keys.pose_explain}?rotations=X_Y")
        with pytest.raises(QueryRefused, match="no frame of glove asked arrives"):
            ask(session, keys.pose_explain)
    assert [angle["rotation"] for angle in everything["rotations"]] == list(LAYOUT.rotations)
    [angle] = found["rotations"]
    pose = eventually(lambda: poses.get(found["sequence"]), "its pose")
    assert found["model"] == pose.model_sha256
    assert np.float32(angle["degrees"]) == pose.degrees[LAYOUT.rotations.index("I_PIP")]
    assert abs(sum(term["degrees"] for term in angle["terms"]) - angle["degrees"]) < 1e-9


def test_an_uncalibrated_glove_has_no_angle(session: zenoh.Session, settings: Settings) -> None:
    keys = GloveKeys(settings.site, "nobody")

    def refusal() -> str:
        try:
            ask(session, keys.pose_explain)
        except QueryRefused as error:
            return str(error)
        return ""

    with sending(WireGlove(session, settings, "nobody")):
        eventually(lambda: "glove nobody is uncalibrated" in refusal(), "it is told")


def test_who_asks_too_much_is_refused_and_never_queued() -> None:
    """Without the thread that answers, so that all wait."""
    with zenoh.open(_alone()) as session:
        waiting = LiveExplanations(session, "lab", list, lambda _: True)
        got = [session.get("glovecal/lab/g1/pose/explain", timeout=0.5) for _ in range(QUERIES_WAITING + 1)]
        said = [
            reply.err.payload.to_string() for replies in got for reply in replies if reply.err is not None
        ]
        assert sum("too many ask at once" in sentence for sentence in said) == 1
        del waiting


def _alone() -> zenoh.Config:
    config = zenoh.Config()
    for name in ("scouting/multicast/enabled", "scouting/gossip/enabled"):
        config.insert_json5(name, json.dumps(False))
    config.insert_json5("listen/endpoints", json.dumps([]))
    return config
