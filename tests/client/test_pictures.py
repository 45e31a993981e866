"""Pictures of any source are kept bit by bit, with a stamp each; what is missing is said."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
import pytest
from loopback import eventually

from glovecal_client.errors import BadOption, DeviceError, DeviceFinished, DeviceLost
from glovecal_client.pictures.recording import VideoRecording
from glovecal_client.pictures.source import Picture, RenderedPictures, build_source
from glovecal_client.pictures.video_file import VideoFilePictures, VideoWriter, times_path

pytest.importorskip("cv2")


def read_to_the_end(source: VideoFilePictures) -> None:
    while True:
        source.read()


def test_a_video_gives_back_every_pixel_and_stamp(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    pictures = [
        Picture(random.integers(0, 256, (48, 64, 3), np.uint8), 10**9 + 33_333_333 * at, 5 * 10**18 + at)
        for at in range(12)
    ]
    writer = VideoWriter(tmp_path / "anna.mkv", 30.0)
    for picture in pictures:
        writer.write(picture)
    writer.close()
    source = build_source(f"video:{tmp_path / 'anna.mkv'}")
    source.open()
    for expected in pictures:
        found = source.read()
        np.testing.assert_array_equal(found.pixels, expected.pixels)
        assert (found.monotonic_ns, found.wall_ns) == (expected.monotonic_ns, expected.wall_ns)
    assert source.rate_hz == pytest.approx(30, abs=0.1)
    with pytest.raises(DeviceFinished, match="after 12 pictures"):
        source.read()
    source.close()


def test_a_recording_runs_beside_whatever_else_goes_on(tmp_path: Path) -> None:
    began_ns = time.monotonic_ns()
    with VideoRecording(build_source("rendered"), tmp_path / "fist.mkv") as video:
        eventually(lambda: video.pictures >= 15, "15 pictures are kept")
    about = json.loads(video.describe(take="abc").read_text())
    assert (about["take"], about["simulated"], about["pictures"]) == ("abc", True, video.pictures)
    source = VideoFilePictures(tmp_path / "fist.mkv")
    source.open()
    stamps = [source.read().monotonic_ns for _ in range(video.pictures)]
    source.close()
    assert stamps == sorted(stamps)
    due_ns = began_ns + np.arange(len(stamps)) * 1e9 / 30
    assert (np.array(stamps) >= due_ns - 1e6).all(), "none comes before it is drawn"


def test_a_source_that_ends_keeps_what_there_was_and_says_why(tmp_path: Path) -> None:
    def draw(time_s: float) -> np.ndarray:
        if time_s > 0.1:
            raise DeviceLost("the camera was pulled")
        return np.zeros((16, 16, 3), np.uint8)

    with VideoRecording(RenderedPictures(draw), tmp_path / "x.mkv") as video:
        eventually(lambda: video.problem, "it is said")
    assert video.problem == "the camera was pulled"
    assert video.pictures == 4


@pytest.mark.parametrize("text", ["camera", "camera:x", "camera:99999", "webcam:0", "video:", ""])
def test_what_is_no_source_is_told_what_there_is(text: str) -> None:
    with pytest.raises(BadOption, match="camera:NUMBER"):
        build_source(text)


def test_files_are_never_overwritten_and_stamps_are_needed(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match=r"must end in \.mkv"):
        VideoWriter(tmp_path / "a.mp4", 30.0)
    (tmp_path / "b.mkv").write_bytes(b"")
    with pytest.raises(DeviceError, match="exists already"):
        VideoWriter(tmp_path / "b.mkv", 30.0)
    with pytest.raises(DeviceLost, match="has no time stamps"):
        VideoFilePictures(tmp_path / "b.mkv").open()
    times_path(tmp_path / "b.mkv").write_text("picture,monotonic_ns,wall_ns\n0,now,2\n")
    with pytest.raises(DeviceLost, match="whole nanoseconds"):
        VideoFilePictures(tmp_path / "b.mkv").open()


def test_a_camera_that_is_not_there_is_said() -> None:
    camera = build_source("camera:63")
    with pytest.raises(DeviceLost, match="camera:63 cannot be opened"):
        camera.open()


def test_a_video_that_ends_in_the_middle_says_how_much_there_is_and_that_it_was_drawn(tmp_path: Path) -> None:
    with VideoRecording(RenderedPictures(rate_hz=100.0), tmp_path / "a.mkv") as video:
        about = json.loads((tmp_path / "a.json").read_text())
        assert about["simulated"] is True
        assert "not ended" in about["problem"]
        time.sleep(0.5)
    content = (tmp_path / "a.mkv").read_bytes()
    (tmp_path / "a.mkv").write_bytes(content[: len(content) * 2 // 3])
    source = VideoFilePictures(tmp_path / "a.mkv")
    source.open()
    assert source.simulated
    with pytest.raises(DeviceFinished, match=rf"ends in the middle: \d+ of {video.pictures} pictures"):
        read_to_the_end(source)
    source.close()
