"""A camera's pictures become poses on real zenoh; what goes wrong is said and counted, nothing is lost."""

from __future__ import annotations

import json
import signal
import subprocess
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zenoh
from realtime_support import eventually, free_endpoint

pytest.importorskip("cv2")
pytest.importorskip("numba")

from camera_support import (
    SMALL,
    ScriptedCamera,
    camera_process,
    prepared_once,
    ran_to_the_end,
    ready_folder,
    running,
)

from glovecal_client.errors import DeviceLost, QueryRefused
from glovecal_client.pictures.label_file import LabelFilePictures
from glovecal_client.pictures.source import Picture
from glovecal_client.pictures.video_file import VideoFilePictures, VideoWriter, read_times
from glovecal_client.pose_subscriber import PoseSubscriber
from glovecal_client.session import ask, ask_json, open_router
from glovecal_client.wire.pose import Pose, PoseFlag, RotationFlag
from glovecal_models.colour_glove.hand_state import FINGER_ROTATIONS, STAGES
from glovecal_models.errors import BadInput
from glovecal_models.hand.skeleton import skeleton_from_document
from glovecal_service.camera.camera_settings import CameraSettings
from glovecal_service.camera.picture_reader import MissingPictures, NewestPicture, NumberedPicture
from glovecal_service.camera.tracking_setup import RATE_HZ, RenderedGlove

PICTURE = np.full((480, 640, 3), 180, np.uint8)
"""Of a wall."""
PERIOD_NS = round(1e9 / RATE_HZ)


@pytest.fixture(scope="module", autouse=True)
def quickly() -> Iterator[None]:
    with prepared_once():
        yield


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cameras")


@pytest.fixture(scope="module")
def glove(data: Path) -> RenderedGlove:
    return ready_folder(data)


@pytest.fixture(scope="module")
def router() -> Iterator[tuple[zenoh.Session, str]]:
    endpoint = free_endpoint()
    with open_router([endpoint]) as session:
        yield session, endpoint


@pytest.fixture
def settings(data: Path, glove: RenderedGlove, router: tuple[zenoh.Session, str]) -> CameraSettings:
    return CameraSettings(
        "camera:0", "right", zenoh=router[1], keep="nothing", data=data, stage="ik", **SMALL
    )


def status_of(session: zenoh.Session, glove: str) -> dict[str, Any]:
    return ask_json(session, f"glovecal/lab/{glove}/status")


def adds_up(camera: dict[str, Any]) -> bool:
    """Every picture that was numbered is accounted for, but for the one that is being tracked."""
    decided = sum(camera[name] for name in ("tracked", "without_hand", "unusable", "skipped", "waiting"))
    return decided <= camera["pictures"] <= decided + 1


def kept_files(data: Path, glove: str, suffix: str) -> list[Path]:
    return sorted((data / "cameras" / "kept").glob(f"{glove}-*{suffix}"))


def test_a_camera_is_a_glove_like_any_other(
    settings: CameraSettings, router: tuple[zenoh.Session, str], data: Path
) -> None:
    """Process, poses, meta, status, picture, stages; kill -9, and the labels up to then are there."""
    session = router[0]
    rendered = replace(settings, source="rendered", glove="drawn", keep="labels")
    with camera_process(rendered) as process, PoseSubscriber(session, "lab", "drawn") as poses:
        pose = eventually(lambda: poses.wait(0.1), "a pose")
        assert poses.rotations(pose) == FINGER_ROTATIONS
        assert pose.simulated
        assert not pose.uncalibrated
        assert abs(time.monotonic_ns() - pose.monotonic_ns) < 60e9
        assert pose.age_us > 0
        assert (pose.deviations > 0).all()
        unsure = (pose.rotation_flags & RotationFlag.TOO_UNCERTAIN) > 0
        assert pose.too_uncertain == unsure.any()
        meta = ask_json(session, "glovecal/lab/drawn/pose/meta")
        assert meta["method"] == "colour_glove_ik"
        assert skeleton_from_document(meta["skeleton"]).hand == meta["hand"] == "right"
        assert ask_json(session, "glovecal/lab/drawn/meta")["simulated"] is True

        camera = eventually(lambda: told(session, "drawn", "tracked", 5), "five poses are told")
        assert camera["simulated"]
        assert camera["sees"] == "hand"
        assert camera["latency_ms"]["p50"] >= camera["computing_ms"]["p50"] > 0
        assert adds_up(camera)
        assert [each["name"] for each in camera["rotations"]] == list(FINGER_ROTATIONS)
        assert 0 <= camera["accepted_share"] <= 1

        (sample,) = ask(session, "glovecal/lab/drawn/picture?layers=picture,model;width=320")
        assert sample.payload.to_bytes().startswith(b"\xff\xd8\xff")
        with pytest.raises(QueryRefused, match="there are picture, labels, model"):
            ask(session, "glovecal/lab/drawn/picture?layers=faces")
        for stage in STAGES:
            ask_json(session, f"glovecal/lab/drawn/control?do=stage;with={stage}")
            named = ask_json(session, "glovecal/lab/drawn/pose/meta")["model"]
            pose = eventually(lambda name=named: of_model(poses, name), f"a pose of stage {stage}")
            assert poses.rotations(pose) == FINGER_ROTATIONS
        with pytest.raises(QueryRefused, match="'best' is none of nearest"):
            ask_json(session, "glovecal/lab/drawn/control?do=stage;with=best")
        known = status_of(session, "drawn")["camera"]["kept_pictures"]
        process.send_signal(signal.SIGKILL)
        process.wait(30)
    (kept,) = kept_files(data, "drawn", ".labels")
    again = ran_to_the_end(replace(settings, source=f"labels:{kept}", glove="again"))
    assert again.pictures >= known
    assert again.tracked + again.skipped == again.pictures
    source = LabelFilePictures(kept)
    source.open()
    assert source.simulated
    source.close()


def told(session: zenoh.Session, glove: str, name: str, least: int) -> dict[str, Any] | None:
    camera = status_of(session, glove)["camera"]
    return camera if camera[name] >= least else None


def of_model(poses: PoseSubscriber, model: str) -> Pose | None:
    pose = poses.wait(0.1)
    return pose if pose is not None and pose.model_sha256 == model else None


def test_every_picture_as_it_came_survives_a_kill(settings: CameraSettings, data: Path) -> None:
    rendered = replace(settings, source="rendered", glove="filmed", keep="pictures", stage="blend")
    with camera_process(rendered) as process:
        film = eventually(lambda: kept_files(data, "filmed", ".mkv"), "a film begins")[0]
        eventually(lambda: len(read_times(film)) >= 45, "1.5 s of pictures")
        process.send_signal(signal.SIGKILL)
        process.wait(30)
    source = VideoFilePictures(film)
    source.open()
    assert source.simulated
    assert source.read().pixels.shape == PICTURE.shape
    source.close()
    again = ran_to_the_end(replace(settings, source=f"video:{film}", glove="killed", stage="blend"))
    assert again.pictures > 0
    assert again.tracked + again.skipped == again.pictures


def test_a_film_that_was_cut_is_tracked_as_far_as_it_goes(
    settings: CameraSettings, glove: RenderedGlove, router: tuple[zenoh.Session, str], tmp_path: Path
) -> None:
    film = tmp_path / "cut.mkv"
    writer = VideoWriter(film, RATE_HZ)
    stamps = [10**9 + PERIOD_NS * at for at in range(24)]
    stamps[7] = stamps[6]
    del stamps[15]
    for at, stamp in enumerate(stamps):
        writer.write(Picture(glove.draw(at / RATE_HZ), stamp, stamp))
    writer.close()
    content = film.read_bytes()
    film.write_bytes(content[: len(content) * 5 // 6])
    heard: list[Pose] = []
    with PoseSubscriber(router[0], "lab", "film", on_pose=heard.append):
        ended = ran_to_the_end(replace(settings, source=f"video:{film}", glove="film"))
    assert "ends in the middle" in ended.sentence
    assert 15 < ended.pictures < 23
    assert ended.stamped_twice == 1
    assert ended.dropped == 1
    assert ended.tracked + ended.skipped == ended.pictures
    steps = {pose.sequence: pose.monotonic_ns - heard[0].monotonic_ns for pose in heard}
    first = heard[0].sequence
    usable = [stamp for at, stamp in enumerate(stamps) if at != 7]
    assert all(step == usable[number] - usable[first] for number, step in steps.items())
    assert not heard[0].simulated


def test_what_goes_wrong_before_a_camera_is_counted_and_said(
    settings: CameraSettings, glove: RenderedGlove, router: tuple[zenoh.Session, str], data: Path
) -> None:
    """No hand, another size, the camera unplugged and back: the next poses are there, all is kept."""
    hand = glove.draw(0.0)
    acts = [
        *[hand] * 6, *[PICTURE] * 6, DeviceLost("camera:0 gives no picture any more"),
        OSError("a driver's own"), *[hand] * 6, *[PICTURE[:240, :320]] * 3,
    ]  # fmt: skip
    camera = ScriptedCamera(list(acts), lambda: time.sleep(0.15))
    faulty = replace(settings, glove="faulty", keep="labels")
    with running(faulty, camera) as (tracking, ended, said):
        while not ended:
            assert adds_up(tracking._status_document()["camera"])
            time.sleep(0.02)
    summary, health = ended[0], tracking.health.document()
    assert health["findings_counted"]["no hand"] >= 1
    assert health["problem"].startswith("the picture is 320 x 240, the camera is calibrated for 640 x 480")
    assert "camera:0 gives no picture any more; trying to open it again" in said
    assert "an unforeseen OSError; trying to open it again" in said
    assert summary.reconnects == 2
    assert summary.pictures == 21
    assert summary.tracked + summary.without_hand + summary.unusable + summary.skipped == 21
    assert min(summary.tracked, summary.without_hand, summary.unusable) > 0
    assert summary.sentence == "all was done"
    assert camera.openings == 4
    assert len(kept_files(data, "faulty", ".labels")) == 2


def test_without_a_hand_the_last_pose_is_repeated_as_stale(
    settings: CameraSettings, glove: RenderedGlove, router: tuple[zenoh.Session, str]
) -> None:
    acts = [*[glove.draw(0.0)] * 4, *[PICTURE] * 14]
    heard: list[Pose] = []
    with PoseSubscriber(router[0], "lab", "gone", on_pose=heard.append):
        ran_to_the_end(replace(settings, glove="gone"), ScriptedCamera(list(acts), lambda: time.sleep(0.1)))
        eventually(lambda: heard and heard[-1].stale, "the last pose, marked", 10)
    assert heard[-1].flags & PoseFlag.SIMULATED


def test_a_disk_that_fails_is_said_and_poses_go_on(settings: CameraSettings, glove: RenderedGlove) -> None:
    """The folder of what is kept is a file."""
    kept = settings.folder / "kept"
    moved = kept.with_name("kept-elsewhere")
    if kept.exists():
        kept.rename(moved)
    kept.write_text("in the way")
    try:
        acts = [glove.draw(0.0)] * 6
        camera = ScriptedCamera(list(acts), lambda: time.sleep(0.1))
        ended = ran_to_the_end(replace(settings, glove="full", keep="labels"), camera)
    finally:
        kept.unlink()
        if moved.exists():
            moved.rename(kept)
    assert ended.tracked > 0
    assert "could not be kept" in ended.kept


def test_a_glove_name_is_given_to_one_publisher(settings: CameraSettings, glove: RenderedGlove) -> None:
    slow = ScriptedCamera([glove.draw(0.0)] * 2000, lambda: time.sleep(0.05))
    with running(replace(settings, glove="mine"), slow) as (first, _, _):
        eventually(lambda: first.health.tracked, "the first tracks")
        second = ScriptedCamera([glove.draw(0.0)] * 2000, lambda: time.sleep(0.05))
        with running(replace(settings, glove="mine"), second) as (_, ended, _):
            eventually(lambda: ended, "the second gives way")
    assert "already published by run" in str(ended[0])


def test_what_cannot_be_started_says_why(settings: CameraSettings) -> None:
    with running(replace(settings, source="camera:63")) as (_, ended, _):
        eventually(lambda: ended, "no camera")
    assert "camera:63 cannot be opened" in str(ended[0])
    with running(replace(settings, source="webcam")) as (_, ended, _):
        eventually(lambda: ended, "no source")
    assert "labels:FILE" in str(ended[0])
    with pytest.raises(BadInput, match="stage 'best' is none of"):
        replace(settings, stage="best")
    with pytest.raises(ValueError, match="glove"):
        replace(settings, glove="../x")


def test_settings_come_back_from_their_text(settings: CameraSettings) -> None:
    assert CameraSettings.from_text(settings.text()) == settings
    json.loads(settings.text())


def test_the_newest_picture_wins_and_the_others_are_counted() -> None:
    newest = NewestPicture()
    for number in range(5):
        newest.put(NumberedPicture(number, Picture.now(PICTURE), 0, 0))
    taken = newest.take(0.0)
    assert taken is not None
    assert (taken.number, newest.skipped, newest.waiting) == (4, 4, 0)
    assert newest.take(0.01) is None
    newest.end()
    assert newest.is_over


@pytest.mark.parametrize(
    ("stamps_ms", "dropped"),
    [
        ([33 * at for at in range(30)], 0),
        ([66 * at for at in range(30)], 0),  # a slower camera
        ([33 * at for at in range(30) if at not in (20, 21)], 2),
        ([33 * at + (25 if at == 20 else 0) for at in range(30)], 0),  # late, and the next in time
        ([*range(20), *[33 * at for at in range(1, 30)]], 0),  # a burst after a slow start
    ],
)
def test_pictures_that_a_camera_dropped_are_told_from_late_ones(stamps_ms: list[int], dropped: int) -> None:
    missing = MissingPictures()
    for stamp in stamps_ms:
        missing.note(stamp * 1_000_000)
    assert missing.dropped == dropped


def test_the_command_says_how_it_ended(settings: CameraSettings, tmp_path: Path) -> None:
    import sys

    command = [sys.executable, "-P", "-m", "glovecal_service.cli.command", "camera", "track", "camera:63"]
    ended = subprocess.run(
        [*command, "--glove", "x", "--data", str(settings.data), "--connect", settings.zenoh],
        capture_output=True, text=True, timeout=100, check=False,
    )  # fmt: skip
    assert ended.returncode == 1
    assert "camera:63 cannot be opened" in ended.stderr


def test_two_gloves_are_said_and_no_rotation_is_accepted_meanwhile(
    settings: CameraSettings, glove: RenderedGlove, router: tuple[zenoh.Session, str]
) -> None:
    one = glove.draw(0.0)
    both = np.concatenate([one[:, 160:480], one[:, 160:480]], axis=1)
    heard: list[Pose] = []
    camera = ScriptedCamera([both] * 8, lambda: time.sleep(0.1))
    with PoseSubscriber(router[0], "lab", "two", on_pose=heard.append):
        with running(replace(settings, glove="two"), camera) as (tracking, ended, _):
            eventually(lambda: ended, "its end")
        eventually(lambda: heard, "a pose")
    health = tracking.health.document()
    assert health["findings_counted"]["two hands"] >= 1
    assert "Two gloves in view" in health["findings"]["two hands"]
    assert (heard[-1].rotation_flags & RotationFlag.TOO_UNCERTAIN).all()
