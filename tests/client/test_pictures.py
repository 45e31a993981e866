"""Pictures of any source are kept bit by bit, with a stamp each; what is missing is said."""

from __future__ import annotations

import json
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from loopback import eventually
from phone_videos import phone_video

from glovecal_client.errors import BadOption, DeviceError, DeviceFinished, DeviceLost
from glovecal_client.pictures.recording import VideoRecording
from glovecal_client.pictures.source import Picture, RenderedPictures, build_source
from glovecal_client.pictures.video_file import (
    VideoFilePictures,
    VideoWriter,
    _settled,
    times_path,
    write_times,
)

cv2 = pytest.importorskip("cv2")


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
    with pytest.raises(DeviceLost, match="cannot be read as a video"):
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


def bars(count: int, height: int = 48, width: int = 64) -> list[np.ndarray]:
    """A bright bar along the upper edge, as many columns long as the picture's number."""
    found = []
    for number in range(count):
        picture = np.zeros((height, width, 3), np.uint8)
        picture[: height // 4, : 2 * number + 2] = 255
        found.append(picture)
    return found


def read_all(source: VideoFilePictures) -> list[Picture]:
    source.open()
    found: list[Picture] = []

    def read_on() -> None:
        while True:
            found.append(source.read())

    with pytest.raises(DeviceFinished):
        read_on()
    source.close()
    return found


@pytest.mark.parametrize("suffix", [".mp4", ".mov"])
def test_a_phones_video_has_its_own_uneven_times(tmp_path: Path, suffix: str) -> None:
    durations_ms = [17 + 8 * (number % 4) for number in range(24)]
    phone_video(tmp_path / f"phone{suffix}", bars(24), durations_ms)
    source = VideoFilePictures(tmp_path / f"phone{suffix}")
    found = read_all(source)
    assert [picture.monotonic_ns for picture in found] == [
        10**6 * sum(durations_ms[:number]) for number in range(24)
    ]
    assert source.stamps.sentence == "the file's own times, a variable rate, 24.4 to 58.8 Hz"
    assert not source.stamps.of_this_computer
    assert found[0].pixels.shape == (48, 64, 3)


@pytest.mark.parametrize("rate_hz", [5, 25, 50, 125])
def test_an_even_rate_is_told(tmp_path: Path, rate_hz: int) -> None:
    phone_video(tmp_path / "a.mp4", bars(10), [1000 // rate_hz] * 10)
    source = VideoFilePictures(tmp_path / "a.mp4")
    source.open()
    assert source.stamps.sentence == f"the file's own times, {rate_hz:.2f} Hz"
    assert source.rate_hz == pytest.approx(rate_hz)
    source.close()


def test_a_phone_held_upright_gives_upright_pictures(tmp_path: Path) -> None:
    for turned_deg, bright in ((0, np.s_[:12, :8]), (90, np.s_[:8, -12:]), (180, np.s_[-12:, -8:])):
        phone_video(tmp_path / f"{turned_deg}.mp4", bars(4)[3:] * 4, [40] * 4, turned_deg=turned_deg)
        (picture, *_) = read_all(VideoFilePictures(tmp_path / f"{turned_deg}.mp4"))
        height, width = (64, 48) if turned_deg == 90 else (48, 64)
        assert picture.pixels.shape == (height, width, 3)
        assert picture.pixels[bright].mean() > 200


def test_a_file_without_times_says_what_is_taken_for_them(tmp_path: Path) -> None:
    writer = cv2.VideoWriter(
        str(tmp_path / "old.avi"), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"MJPG"), 20.0, (64, 48)
    )
    for picture in bars(6):
        writer.write(picture)
    writer.release()
    source = VideoFilePictures(tmp_path / "old.avi")
    found = read_all(source)
    assert [picture.monotonic_ns for picture in found] == [50_000_000 * number for number in range(6)]
    assert source.stamps.sentence == (
        "the file has no times of its pictures: taken as even, 20.00 Hz, as its header says"
    )


@pytest.mark.parametrize(
    ("times_ms", "said_hz", "told"),
    [
        ([0.0] * 5, 25.0, "25.00 Hz, as its header says"),
        ([0.0, 40.0, 10.0, 5.0, 3.0], 0.0, "30.00 Hz, which is assumed"),
        ([7.0, 40.0, 74.0, 107.0, 140.0], 30.0, "the file's own times, 30.08 Hz"),
        ([12.0], 25.0, "the file's own times"),
    ],
)
def test_stamps_that_do_not_increase_are_none(times_ms: list[float], said_hz: float, told: str) -> None:
    settled, sentence = _settled(times_ms, said_hz, has_stamps=True)
    assert told in sentence
    assert settled[0] == 0.0
    assert all(later > before for before, later in pairwise(settled))


def test_times_that_were_written_beside_a_video_count(tmp_path: Path) -> None:
    phone_video(tmp_path / "a.mp4", bars(5), [40] * 5)
    stamps = [(10**9 * number, 5 * 10**18) for number in range(5)]
    write_times(tmp_path / "a.mp4", stamps)
    source = VideoFilePictures(tmp_path / "a.mp4")
    assert [(picture.monotonic_ns, picture.wall_ns) for picture in read_all(source)] == stamps
