"""The real-time process over real zenoh: poses, model choice, bad input, exact books."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
import zenoh
from effect_models import FOLLOWED, HYSTERESIS, UNITS, added, model_with
from realtime_support import (
    LAYOUT,
    WireGlove,
    eventually,
    free_endpoint,
    glove_status,
    linear_model,
    part_of_service,
    service_status,
    store_model,
)

from glovecal_client.errors import NoAnswer, ServiceError
from glovecal_client.keys import GloveKeys, all_services
from glovecal_client.pose_subscriber import PoseSubscriber
from glovecal_client.session import ask_json, open_client
from glovecal_client.wire.frame import encode_frame
from glovecal_client.wire.pose import Pose, decode_pose
from glovecal_models.calibration.artifact import dump
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.hand.skeleton import Skeleton, skeleton_from_document
from glovecal_service.realtime.model_watcher import choose
from glovecal_service.rest.in_process import in_process_client
from glovecal_service.serve import real_time
from glovecal_service.settings import Settings
from glovecal_service.store import Store


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Settings:
    data = tmp_path_factory.mktemp("realtime")
    return Settings(data=data, database=None, artifacts=None, zenoh=free_endpoint(), site="lab")


@pytest.fixture(scope="module")
def store(settings: Settings) -> Iterator[Store]:
    with Store.open(settings) as store:
        store.layouts.put(LAYOUT)
        yield store


@pytest.fixture(scope="module")
def session(settings: Settings, store: Store) -> Iterator[zenoh.Session]:
    with part_of_service(real_time, settings), open_client([settings.zenoh], wait_s=20) as session:
        yield session


class Poses:
    """Every pose of a glove, in the order it came."""

    def __init__(self, session: zenoh.Session, glove: WireGlove) -> None:
        self.all: list[Pose] = []
        handler = zenoh.handlers.Callback(self._hear, indirect=False)
        self._subscriber = session.declare_subscriber(glove.keys.pose, handler)

    def _hear(self, sample: zenoh.Sample) -> None:
        self.all.append(decode_pose(sample.payload.to_bytes()))

    @property
    def live(self) -> list[Pose]:
        return [pose for pose in list(self.all) if not pose.stale]


def ask_meta(session: zenoh.Session, glove: WireGlove) -> dict:
    try:
        return ask_json(session, glove.keys.pose_meta)
    except NoAnswer:
        return {}


def served(session: zenoh.Session, glove: WireGlove, model: str | None) -> dict | None:
    meta = ask_meta(session, glove)
    return meta if meta and meta["model"] == model else None


def balanced(session: zenoh.Session, settings: Settings, glove: WireGlove) -> dict | None:
    """The glove's books once all that was sent is accounted for."""
    books = glove_status(session, settings, glove.keys.glove)
    if books.get("received") != glove.sent:
        return None
    accounted = books["predicted"] + books["skipped"] + sum(books["refused"].values())
    return books if accounted == books["received"] else None


def test_poses_are_what_the_active_model_predicts(
    session: zenoh.Session, settings: Settings, store: Store
) -> None:
    model_id = store_model(store, "anna", degrees_per_count=0.5)
    glove = WireGlove(session, settings, "g-anna", subject="anna")
    poses = Poses(session, glove)
    glove.say_meta()
    eventually(lambda: served(session, glove, model_id), "the glove is served")
    rows = [(120.0 + n, 130.0, 140.0 - n) for n in range(20)]
    for row in rows:
        glove.send(row)
        time.sleep(0.004)
    eventually(lambda: len(poses.live) == 20, "all poses")
    expected = GlovePredictor(linear_model("anna", degrees_per_count=0.5)).predict(np.array(rows))
    np.testing.assert_allclose([pose.degrees for pose in poses.live], expected.mean, rtol=1e-5)
    np.testing.assert_allclose([pose.deviations for pose in poses.live], expected.sd, rtol=1e-5)
    assert [pose.sequence for pose in poses.live] == list(range(20))
    assert {(pose.model_sha256, pose.run_id) for pose in poses.live} == {(model_id, glove.run_id)}
    with PoseSubscriber(session, settings.site, "g-anna") as subscriber:
        assert subscriber.rotations(poses.live[-1]) == LAYOUT.rotations


def test_a_glove_of_the_other_hand_is_told_with_its_first_frames(
    session: zenoh.Session, settings: Settings, store: Store
) -> None:
    model_id = store_model(store, "anna", degrees_per_count=0.5)
    store.subjects.measure("anna", {}, hand="right")
    glove = WireGlove(session, settings, "g-left", subject="anna")
    glove.say_meta(hand="left")
    eventually(lambda: served(session, glove, model_id), "the glove is served")
    assert "wrong hand: g-left is a left glove and anna a right hand" in ask_meta(session, glove)["sentence"]
    glove.send()
    eventually(lambda: glove_status(session, settings, "g-left").get("predicted") == 1, "a pose")
    with in_process_client(settings) as rest:

        def told() -> bool:
            """A busy computer's answers may miss one question's time."""
            (row,) = [one for one in rest.get("/live-gloves") if one["glove"] == "g-left"]
            served_by = (row["model"], row["warnings"]) == (model_id, [])
            return served_by and row["sentence"].startswith("wrong hand")

        eventually(told, "the page's row")
    glove.restart()
    glove.say_meta(hand="right")
    eventually(lambda: not ask_meta(session, glove)["sentence"], "exchanged")


def test_pose_meta_holds_the_wearers_hand_for_whoever_draws_it(
    session: zenoh.Session, settings: Settings, store: Store
) -> None:
    model_id = store_model(store, "hanna", degrees_per_count=0.5)
    glove = WireGlove(session, settings, "g-hanna", subject="hanna")
    glove.say_meta()
    meta = eventually(lambda: served(session, glove, model_id), "the glove is served")
    assert (meta["hand"], meta["skeleton"]) == ("unknown", None)
    store.subjects.measure("hanna", {"hand_length": 182.0}, hand="left")

    def drawn(hand: str) -> Skeleton | None:
        found = ask_meta(session, glove)
        return skeleton_from_document(found["skeleton"]) if found.get("hand") == hand else None

    as_said = store.subjects.get("hanna").skeleton
    assert eventually(lambda: drawn("left"), "the subject's hand") == as_said("left")
    glove.say_meta(hand="right")
    assert eventually(lambda: drawn("right"), "the glove's hand") == as_said("right")


def test_effects_are_told_the_wearing_and_the_context(
    session: zenoh.Session, settings: Settings, store: Store
) -> None:
    shift = added("donning_shift", (), (3.0, 0.0), settings={"wearings": ["monday"], **UNITS})
    span = {"low": 20.0, "high": 30.0, "usual": 25.0}
    heat = added("temperature", (), (10.0, 0.0), settings={**span, **FOLLOWED, **UNITS})
    model = replace(model_with(HYSTERESIS, shift, heat), subject="effie")
    store.subjects.create("effie")
    record = store.models.add(
        dump(model), subject="effie", layout=LAYOUT.name, method="linear", parent=None, facts={}
    )
    store.models.activate(record.id)
    glove = WireGlove(session, settings, "g-effie", subject="effie")
    poses = Poses(session, glove)
    glove.say_meta(wearing="monday", context=["supply_v"])
    meta = eventually(lambda: served(session, glove, record.id), "the glove is served")
    assert (meta["wearing"], meta["effects"]) == ("monday", ["hysteresis", "donning_shift", "temperature"])
    glove.send(context=np.array([4.9], np.float32))
    eventually(lambda: len(poses.live) == 1, "the first pose")
    assert (poses.live[0].state_reset, poses.live[0].settling) == (True, True)
    effects = glove_status(session, settings, "g-effie")["effects"]
    assert effects["sentences"] == ["context temperature_c is not sent: temperature is not corrected"]
    glove.restart()
    glove.say_meta(wearing="monday", context=["temperature_c"])

    def is_corrected() -> bool:
        glove.send(context=np.array([30.0], np.float32))
        return not glove_status(session, settings, "g-effie")["effects"]["sentences"]

    eventually(is_corrected, "the temperature is corrected")
    base = GlovePredictor(model).predict(np.array([[120.0, 130.0, 140.0]])).mean
    # The status may arrive before the last poses do.
    eventually(lambda: np.allclose(poses.live[-1].degrees, base[0] + 8.0), "its pose")
    np.testing.assert_allclose(poses.live[0].degrees, base[0] + 3.0, rtol=1e-5)
    np.testing.assert_allclose(poses.live[-1].degrees, base[0] + 8.0, rtol=1e-5)
    store.gloves.assign("g-effie", "effie", "tuesday")

    def is_another_wearing() -> bool:
        glove.send(context=np.array([30.0], np.float32))
        return glove_status(session, settings, "g-effie")["effects"]["starts"] == 3  # a new run did, too

    eventually(is_another_wearing, "a new wearing begins anew")
    said = glove_status(session, settings, "g-effie")["effects"]["sentences"]
    assert said == ["wearing 'tuesday' was not in training: donning_shift is not corrected"]


def test_activation_and_roll_back_change_the_model_between_two_frames(
    session: zenoh.Session, settings: Settings, store: Store
) -> None:
    first = store_model(store, "ben", degrees_per_count=0.5)
    second = store_model(store, "ben", degrees_per_count=1.0, activate=False)
    glove = WireGlove(session, settings, "g-ben", subject="ben")
    poses = Poses(session, glove)
    glove.say_meta()
    eventually(lambda: served(session, glove, first), "first model")
    for change, model_id in ((lambda: store.models.activate(second), second),
                             (lambda: store.models.rollback("ben", LAYOUT.name), first)):  # fmt: skip
        change()

        def is_served(model_id: str = model_id) -> bool:
            glove.send((140.0, 140.0, 140.0))
            return bool(poses.live) and poses.live[-1].model_sha256 == model_id

        eventually(is_served, "the other model")
    degrees = {pose.model_sha256: round(float(pose.degrees[0]), 2) for pose in poses.live}
    assert degrees == {first: 20.0, second: 40.0}
    assert [pose.sequence for pose in poses.live] == sorted({pose.sequence for pose in poses.live})
    eventually(lambda: balanced(session, settings, glove), "balanced books")


def test_a_damaged_artifact_is_named_and_the_model_before_it_stays(
    session: zenoh.Session, settings: Settings, store: Store
) -> None:
    good = store_model(store, "carla", degrees_per_count=0.5)
    glove = WireGlove(session, settings, "g-carla", subject="carla")
    glove.say_meta()
    eventually(lambda: served(session, glove, good), "good model")
    store.gloves.seen("g-carla", {"layout": LAYOUT.name, "subject": "carla"})
    bad = store_model(store, "carla", degrees_per_count=1.0, activate=False)
    path = next(settings.artifacts_folder.rglob(f"*{bad}*"))
    content = path.read_bytes()
    store.models.activate(bad)
    path.chmod(0o644)
    path.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    for damaged in (True, False):
        if not damaged:
            path.unlink()
        serving = choose(store, "g-carla", None, {})
        assert serving.model is not None
        assert serving.model.model_id == good
        assert bad in serving.sentence
        assert f"model {good[:12]}, active before it, is served" in serving.sentence
        assert f"glovecal model rollback --subject carla --layout {LAYOUT.name}" in serving.sentence
    path.write_bytes(content)
    eventually(lambda: served(session, glove, bad), "the repaired model, without being told")


def test_a_model_damaged_while_it_is_served_stays_and_the_status_says_what_to_do(
    session: zenoh.Session, settings: Settings, store: Store
) -> None:
    model = store_model(store, "gerda", degrees_per_count=0.5)
    glove = WireGlove(session, settings, "g-gerda", subject="gerda")
    poses = Poses(session, glove)
    glove.say_meta()
    eventually(lambda: served(session, glove, model), "the model is served")
    path = settings.artifacts_folder / model
    content = path.read_bytes()
    path.write_bytes(content[:-100])

    def sentence() -> str:
        return glove_status(session, settings, "g-gerda").get("sentence") or ""

    told = eventually(sentence, "the damage is told")
    assert f"model {model[:12]} is served as it was loaded before: artifact {model}" in told
    assert "restore that file from a backup, or train again: glovecal train --subject gerda" in told
    glove.send()
    eventually(lambda: poses.live, "a pose")
    assert poses.live[-1].model_sha256 == model
    path.write_bytes(content)
    eventually(lambda: not sentence(), "the repair is noticed")


def test_an_unknown_wearer_gets_marked_poses_without_angles(
    session: zenoh.Session, settings: Settings
) -> None:
    glove = WireGlove(session, settings, "g-nobody")
    poses = Poses(session, glove)
    glove.say_meta()
    glove.send()
    eventually(lambda: poses.live, "a pose")
    assert poses.live[0].uncalibrated
    assert len(poses.live[0].degrees) == 0
    assert poses.live[0].model_sha256 is None
    meta = eventually(lambda: ask_meta(session, glove), "pose meta")
    eventually(lambda: "nobody wears" in ask_meta(session, glove)["sentence"], "the reason")
    assert meta["state"] == "uncalibrated"


def test_a_silent_glove_is_marked_stale_about_once_a_second(
    session: zenoh.Session, settings: Settings
) -> None:
    glove = WireGlove(session, settings, "g-silent")
    poses = Poses(session, glove)
    glove.send()
    eventually(lambda: len(poses.all) >= 3, "stale poses")
    assert [pose.stale for pose in poses.all[:3]] == [False, True, True]
    ages = [pose.age_us for pose in poses.all[:3]]
    assert ages[0] < ages[1] < ages[2]
    assert ages[1] >= 500_000
    assert ages[2] - ages[1] >= 900_000


def test_bad_frames_are_counted_by_reason_and_reach_no_model(
    session: zenoh.Session, settings: Settings, store: Store
) -> None:
    model_id = store_model(store, "dora", degrees_per_count=0.5)
    glove = WireGlove(session, settings, "g-dora", subject="dora")
    poses = Poses(session, glove)
    glove.say_meta()
    eventually(lambda: served(session, glove, model_id), "the glove is served")
    good = glove.send()
    glove.send_bytes(good)
    glove.send_bytes(good[:-1])
    glove.send_bytes(good[:4] + b"\x07" + good[5:])
    glove.send_bytes(bytes(40_000))
    glove.send((120.0, 130.0))
    glove.send((120.0, 130.0, 400.0))
    glove.send(monotonic_ns=5)
    glove.send_bytes(encode_frame(glove.frame(run_id=7, sequence=0)))
    glove.send()
    books = eventually(lambda: balanced(session, settings, glove), "balanced books")
    assert books["refused"] == {
        "duplicate": 1, "damaged": 2, "unknown_version": 1, "sensor_count": 1, "out_of_range": 1,
        "time_backwards": 1, "second_publisher": 1,
    }  # fmt: skip
    assert books["predicted"] == 2
    assert [pose.sequence for pose in poses.live] == [0, glove.sequence - 1]


def test_a_wild_number_costs_one_frame_and_a_real_jump_is_followed(
    session: zenoh.Session, settings: Settings
) -> None:
    glove = WireGlove(session, settings, "g-wild")
    poses = Poses(session, glove)

    for number in [*range(20), 999_999_999, 2**64 - 1, *range(20, 40)]:
        glove.send(sequence=number)
        time.sleep(0.005)
    books = eventually(lambda: balanced(session, settings, glove), "balanced books")
    assert books["refused"] == {"sequence_jump": 2}
    assert [pose.sequence for pose in poses.live] == list(range(40))

    def goes_on(begins_at: int) -> Callable[[], bool]:
        """The glove sends on from there until its poses have these numbers."""
        numbers = itertools.count(begins_at)

        def send_one() -> bool:
            glove.send(sequence=next(numbers))
            return begins_at <= poses.live[-1].sequence < begins_at + 10**6

        return send_one

    for jumps, begins_at in enumerate((10**12, 10**7, 0), start=1):
        eventually(goes_on(begins_at), f"poses from {begins_at} on")
        books = eventually(lambda: balanced(session, settings, glove), "balanced books")
        assert (books["jumps"], books["missing"]) == (jumps, 0)


def test_a_glove_with_other_sensors_than_its_model_stays_uncalibrated(
    session: zenoh.Session, settings: Settings, store: Store
) -> None:
    store_model(store, "emil", degrees_per_count=0.5)
    glove = WireGlove(session, settings, "g-emil", subject="emil")
    glove.say_meta(sensors=["A", "B"])
    sentence = eventually(lambda: ask_meta(session, glove).get("sentence"), "the reason")
    assert "needs sensors I_MCP, I_PIP, M_MCP, which this glove does not send" in sentence
    assert ask_meta(session, glove)["model"] is None


def test_a_layout_is_matched_by_its_sensors_whatever_its_name_and_their_order(
    session: zenoh.Session, settings: Settings, store: Store
) -> None:
    model_id = store_model(store, "gina", degrees_per_count=0.5)
    glove = WireGlove(session, settings, "g-gina", subject="gina")
    poses = Poses(session, glove)
    glove.say_meta(layout="monday-frames", sensors=list(reversed(LAYOUT.sensors)))
    meta = eventually(lambda: served(session, glove, model_id), "the glove is served")
    assert (meta["layout"], meta["sentence"]) == ("monday-frames", "")
    glove.send((140.0, 130.0, 120.0))
    eventually(lambda: poses.live, "a pose")
    expected = GlovePredictor(linear_model("gina", degrees_per_count=0.5)).predict(
        np.array([(120.0, 130.0, 140.0)])
    )
    np.testing.assert_allclose(poses.live[0].degrees, expected.mean[0], rtol=1e-5)


@pytest.mark.parametrize(
    ("sensors", "why"),
    [
        (["I_MCP", "I_PIP"], "needs sensor M_MCP, which this glove does not send"),
        ([*LAYOUT.sensors, "P_PIP"], "does not know sensor P_PIP, which this glove sends"),
        ([*LAYOUT.sensors[:2], "I_PIP"], "cannot read a glove that names a sensor twice"),
    ],
)
def test_where_no_model_fits_the_sentence_says_why(store: Store, sensors: list[str], why: str) -> None:
    model_id = store_model(store, "hugo", degrees_per_count=0.5)
    meta = {"layout": "other", "subject": "hugo", "sensors": sensors}
    serving = choose(store, "g-hugo", meta, {})
    assert serving.model is None
    assert f"model {model_id[:12]} {why}" in serving.sentence
    assert serving.sentence.startswith("subject hugo has no active model for this glove (layout other); ")


def test_models_that_are_not_active_are_named(store: Store) -> None:
    meta = {"layout": "other", "subject": "ida", "sensors": list(LAYOUT.sensors)}
    store.subjects.create("ida")
    assert "subject ida has no model yet; train one" in choose(store, "g-ida", meta, {}).sentence
    store_model(store, "ida", degrees_per_count=0.5, activate=False)
    newest = store_model(store, "ida", degrees_per_count=0.7, activate=False)
    sentence = choose(store, "g-ida", meta, {}).sentence
    assert "2 models exist that would fit, activate one" in sentence
    assert f"glovecal model activate {newest[:12]}" in sentence


def test_a_flood_is_accounted_for_to_the_last_frame(
    session: zenoh.Session, settings: Settings, store: Store
) -> None:
    model_id = store_model(store, "fritz", degrees_per_count=0.5)
    glove = WireGlove(session, settings, "g-fritz", subject="fritz")
    glove.say_meta()
    eventually(lambda: served(session, glove, model_id), "the glove is served")
    for _ in range(3000):
        glove.send()
    time.sleep(0.3)

    def settled() -> dict | None:
        before = glove_status(session, settings, "g-fritz")
        time.sleep(0.1)
        after = glove_status(session, settings, "g-fritz")
        return after if after["received"] == before["received"] and not after["waiting"] else None

    books = eventually(settled, "the flood is over")
    assert 0 < books["received"] <= 3000
    refused = sum(books["refused"].values())  # after a loss, faster than any glove
    assert books["predicted"] + books["skipped"] + refused == books["received"]
    glove.send()
    poses = Poses(session, glove)
    eventually(lambda: poses.all or (glove.send() and None), "served after the flood")
    assert poses.all[0].skipped == books["skipped"]


def test_status_and_liveliness_tell_that_the_service_is_there(
    session: zenoh.Session, settings: Settings
) -> None:
    status = service_status(session, settings)
    assert status["database"] == ""
    tokens = [reply.ok for reply in session.liveliness().get(all_services(settings.site), timeout=60)]
    assert [str(token.key_expr).split("/")[3] for token in tokens if token] == [status["instance"]]
    assert (settings.data / "realtime.alive").exists()


def test_junk_on_many_names_keeps_no_new_glove_out(
    session: zenoh.Session, settings: Settings, store: Store
) -> None:
    model_id = store_model(store, "newcomer", degrees_per_count=0.5)
    enough = threading.Event()

    def send_junk() -> None:
        while not enough.is_set():
            for number in range(300):
                session.put(GloveKeys(settings.site, f"junk{number}").raw, b"GLVF is no frame")
            enough.wait(0.05)

    thread = threading.Thread(target=send_junk)
    thread.start()
    try:
        eventually(lambda: places(session, settings)["refused_messages"]["no_room"], "all places are taken")
        glove = WireGlove(session, settings, "g-newcomer", subject="newcomer")
        poses = Poses(session, glove)
        glove.say_meta()

        def is_served() -> bool:
            glove.send()
            return bool(poses.live) and poses.live[-1].model_sha256 == model_id

        eventually(is_served, "poses of the new glove")
    finally:
        enough.set()
        thread.join()
    books = eventually(lambda: balanced(session, settings, glove), "balanced books")
    assert (books["predicted"], books["refused"]) == (glove.sent, {})
    document = places(session, settings)
    assert document["served"] == document["limit"]
    assert document["given_up"]["gloves"] >= 1
    assert "junk" in document["sentence"]


def places(session: zenoh.Session, settings: Settings) -> dict:
    return service_status(session, settings)["places"]


def test_a_glove_with_a_delay_says_so_and_its_poses_wait_for_later_frames(
    session: zenoh.Session, settings: Settings, store: Store
) -> None:
    model_id = store_model(store, "lena", degrees_per_count=0.5)
    glove = WireGlove(session, settings, "g-late", subject="lena")
    with in_process_client(settings) as rest:
        assert rest.put("/gloves/g-late/delay", {"delay_ms": 100})["delay_ms"] == 100
        with pytest.raises(ServiceError, match="delay_ms"):
            rest.put("/gloves/g-late/delay", {"delay_ms": 501})
    glove.say_meta()
    meta = eventually(lambda: served(session, glove, model_id), "the glove is served")
    assert meta["delay_ms"] == 100
    heard: list[tuple[int, Pose]] = []

    def hear(sample: zenoh.Sample) -> None:
        heard.append((time.monotonic_ns(), decode_pose(sample.payload.to_bytes())))

    subscriber = session.declare_subscriber(glove.keys.pose, zenoh.handlers.Callback(hear, indirect=False))
    times = {}
    for number in range(60):
        frame = glove.frame((120.0 + number, 130.0, 140.0))
        times[frame.sequence] = frame.monotonic_ns
        glove.send_bytes(encode_frame(frame))
        glove.sequence += 1
        time.sleep(0.005)
    eventually(lambda: any(pose.stale for _, pose in list(heard)), "the last pose, marked as stale")
    subscriber.undeclare()
    poses = [(at, pose) for at, pose in heard if not pose.stale]
    assert [pose.sequence for _, pose in poses] == list(range(60))
    for at, pose in poses:
        assert pose.monotonic_ns == times[pose.sequence]
        assert at - pose.monotonic_ns >= 100_000_000
    assert max(pose.age_us for _, pose in poses) >= 100_000
    books = eventually(lambda: balanced(session, settings, glove), "the books")
    assert books["predicted"] == 60
    with in_process_client(settings) as rest:
        rest.put("/gloves/g-late/delay", {"delay_ms": 0})
    eventually(lambda: ask_meta(session, glove).get("delay_ms") == 0, "live again")
