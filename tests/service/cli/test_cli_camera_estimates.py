"""Recordings of the colour glove to the estimates of a take's reference; what is broken is said."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[1]))
pytest.importorskip("cv2")
pytest.importorskip("numba")

from camera_support import BESIDE, SMALL, prepared_once, ready_folder
from cli_running import Run, glovecal
from other_gloves import other_hand

from glovecal_client.pictures.label_file import LabelWriter
from glovecal_client.pictures.source import Picture
from glovecal_client.pictures.video_file import VideoWriter
from glovecal_models.colour_glove.camera_model import Camera, write_cameras
from glovecal_models.colour_glove.pattern import printed_pattern
from glovecal_models.colour_glove.photograph import hand_motion
from glovecal_models.colour_glove.pose.both_ways import followed_both_ways
from glovecal_models.colour_glove.rasterise import rasterise
from glovecal_models.colour_glove.skin import hand_skin, posed
from glovecal_models.errors import Cancelled
from glovecal_models.takes.camera_estimates import read_estimates
from glovecal_service.camera.camera_settings import TrackingSettings
from glovecal_service.camera.recorded_estimates import Recordings, matched
from glovecal_service.camera.tracking_setup import ASSUMED, RATE_HZ, RenderedGlove, tracking_setup

PERIOD_NS = round(1e9 / RATE_HZ)


@pytest.fixture(scope="module", autouse=True)
def quickly() -> Iterator[None]:
    with prepared_once():
        yield


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("estimates")


@pytest.fixture(scope="module")
def glove(data: Path) -> RenderedGlove:
    return ready_folder(data)


@pytest.fixture
def estimates(data: Path, glove: RenderedGlove) -> Run:
    """``glovecal camera estimates`` on the small database."""
    small = [part for name, value in SMALL.items() for part in (f"--{name}", value)]
    return partial(glovecal, {"GLOVECAL_DATA": str(data)}, "camera", "estimates", *small)


def drawn(camera: Camera, count: int) -> list[np.ndarray]:
    """Label images of a moving hand that is not quite the model's."""
    hand, pattern = other_hand(hand_skin(), 5), printed_pattern()
    return [
        rasterise(posed(hand, state), hand.triangles, camera).painted(pattern.colour)
        for state in hand_motion(hand, count / RATE_HZ, RATE_HZ, seed=5)[:count]
    ]


def labels_file(file: Path, pictures: Sequence[np.ndarray], stamps_ns: Sequence[int], **facts: Any) -> Path:
    writer = LabelWriter(file, pictures[0].shape, {"simulated": False, **facts})  # type: ignore[arg-type]
    for picture, stamp in zip(pictures, stamps_ns, strict=True):
        writer.write(picture, stamp, stamp)
    writer.close()
    return file


def test_every_frame_is_tracked_and_what_is_broken_is_counted(
    estimates: Run, glove: RenderedGlove, data: Path, tmp_path: Path
) -> None:
    pictures = drawn(ASSUMED, 14)
    pictures[6] = pictures[7] = np.zeros_like(pictures[0])
    stamps = [10**9 + PERIOD_NS * at for at in range(14)]
    stamps[3] = stamps[2]
    film = labels_file(tmp_path / "hand.labels", pictures, stamps, simulated=True)
    content = film.read_bytes()
    film.write_bytes(content[:-50])
    done = estimates(film, "--out", tmp_path / "hand.npz", "--json")
    said, found = done.json, read_estimates(tmp_path / "hand.npz")
    (count,) = said["recordings"]
    assert (count["frames"], count["stamped_twice"], count["unmatched"]) == (13, 1, 0)
    assert "ends in the middle of a picture after 13 pictures" in count["ended"]
    assert count["rate_hz"] == pytest.approx(RATE_HZ, rel=0.01)
    assert (said["frames"], said["without_hand"], said["unusable"]) == (12, 2, 0)
    assert found.simulated
    assert found.time_s == pytest.approx([stamps[at] / 1e9 for at in range(13) if at != 3])
    assert np.isnan(found.angles_deg[[5, 6]]).all()
    # As the library follows them.
    setup = tracking_setup(TrackingSettings(data=data, **SMALL), ["rendered"])
    moments = [([pictures[at]], stamps[at] / 1e9) for at in range(13) if at != 3]
    poses = followed_both_ways(setup.tracker("dense"), setup.tracker("dense"), moments)
    for row, pose in enumerate(poses):
        if pose is not None:
            assert found.angles_deg[row] == pytest.approx(pose.state.angles_deg)
            assert (found.accepted[row] == pose.accepted).all()
    rows = {row["rotation"]: row for row in said["rotations"]}
    assert rows["I_PIP"]["mean_sd_deg"] == pytest.approx(
        np.nanmean(found.sd_deg[:, found.rotations.index("I_PIP")])
    )
    plain = estimates(film, "--out", tmp_path / "again.npz", "--stage", "blend")
    assert said["shape"] == {"refused": "12 pictures; the shape needs at least 20, of different poses"}
    assert "12 frames tracked in" in plain.out
    assert "2 without a hand" in plain.out
    assert "mean SD of accepted, degrees" in plain.out
    assert "marked as simulated" in plain.out
    assert "13 frames at 30.0 Hz (times of " in plain.out
    assert "), 1 stamped twice." in plain.out


def test_a_video_is_tracked_as_far_as_it_can_be_read(
    estimates: Run, glove: RenderedGlove, tmp_path: Path
) -> None:
    film = VideoWriter(tmp_path / "hand.mkv", RATE_HZ)
    one = glove.draw(0.0)
    both = np.concatenate([one[:, 160:480], one[:, 160:480]], axis=1)
    for at in range(12):
        stamp = 10**9 + PERIOD_NS * at
        film.write(Picture(both if at >= 6 else one, stamp, stamp))
    film.close()
    content = film.path.read_bytes()
    film.path.write_bytes(content[: len(content) * 5 // 6])
    write_cameras(tmp_path / "other.json", [Camera(320, 240, (266.0, 266.0), (159.5, 119.5))])
    refused = estimates(film.path, "--out", tmp_path / "no.npz", "--calibration", tmp_path / "other.json")
    assert refused.code == 1
    assert "is of 320 x 240" in refused.said
    assert "gives 640 x 480" in refused.said
    done = estimates(film.path, "--out", tmp_path / "hand.npz", "--json", "--stage", "ik")
    (count,) = done.json["recordings"]
    assert 6 < done.json["frames"] < 12
    assert count["unreadable"] == 12 - done.json["frames"]
    assert f"{done.json['frames']} of 12 pictures can be read" in count["ended"]
    found = read_estimates(tmp_path / "hand.npz")
    assert not found.simulated
    blamed = done.json["findings"]["two hands"]
    assert 1 <= blamed <= done.json["frames"] - 6
    assert not found.accepted[-blamed:].any()
    assert "not calibrated" in done.err


def test_frames_of_two_cameras_are_matched_by_their_times(
    estimates: Run, glove: RenderedGlove, tmp_path: Path
) -> None:
    stamps = np.array([10**9 + PERIOD_NS * at for at in range(8)])
    left = labels_file(tmp_path / "left.labels", drawn(ASSUMED, 8), stamps.tolist(), computer="a")
    beside = np.delete(stamps + 5_000_000, 4).tolist()
    seen = drawn(BESIDE, 8)
    del seen[4]
    right = labels_file(tmp_path / "right.labels", seen, beside, computer="a")
    calibration, file = tmp_path / "two.json", tmp_path / "both.npz"
    write_cameras(calibration, [ASSUMED, BESIDE])
    done = estimates(left, right, "--out", file, "--calibration", calibration, "--json")
    assert [each["unmatched"] for each in done.json["recordings"]] == [1, 0]
    found = read_estimates(file)
    assert found.time_s == pytest.approx((np.delete(stamps, 4) + 2_500_000) / 1e9)
    assert np.isfinite(found.angles_deg).all()
    alone = estimates(left, right, "--out", tmp_path / "no.npz")
    assert "only with their calibration" in alone.said
    write_cameras(calibration, [ASSUMED])
    one = estimates(left, right, "--out", tmp_path / "no.npz", "--calibration", calibration)
    assert "holds 1 camera, 2 are to be tracked" in one.said
    elsewhere = labels_file(tmp_path / "elsewhere.labels", seen, beside, computer="b")
    for other, why in (
        (elsewhere, "two computers"),
        (left, "named twice"),
        (labels_file(tmp_path / "later.labels", seen, [s + 10**10 for s in beside]), "same time"),
        (calibration, "no recording of a camera"),
    ):
        refused = estimates(left, other, "--out", tmp_path / "no.npz", "--calibration", calibration)
        assert (refused.code, why in refused.said) == (1, True), refused.said
    assert "ends in .npz" in estimates(left, "--out", tmp_path / "no.csv").said
    assert not (tmp_path / "no.npz").exists()


def test_what_is_stopped_writes_nothing(data: Path, glove: RenderedGlove, tmp_path: Path) -> None:
    film = labels_file(tmp_path / "hand.labels", drawn(ASSUMED, 6), [PERIOD_NS * (at + 1) for at in range(6)])
    recorded, said = Recordings([film]), list[float]()
    setup = tracking_setup(TrackingSettings(data=data, **SMALL), recorded.sources)
    with pytest.raises(Cancelled, match="tracking the recording was cancelled"):
        recorded.tracked(setup, "ik", lambda _, share: said.append(share), lambda: len(said) >= 3)
    assert said == pytest.approx([1 / 6, 2 / 6, 3 / 6])


times = st.lists(st.integers(1, 60), min_size=1, max_size=30).map(lambda steps: np.cumsum(steps) / 1000.0)


@given(times, times, st.floats(-0.05, 0.05))
def test_matched_frames_are_each_others_nearest(first: np.ndarray, second: np.ndarray, shift: float) -> None:
    second = second + shift
    rows, others = matched(first, second)
    steps = [np.diff(each) for each in (first, second) if len(each) > 1]
    within = 0.5 * min([float(np.median(step)) for step in steps] + [1 / 30] * (2 - len(steps)))
    apart = np.abs(first[:, None] - second[None])
    assert (np.diff(rows) > 0).all()
    assert (np.diff(others) > 0).all()
    assert (apart[rows, others] <= within).all()
    assert (apart[rows, others] == apart[rows].min(axis=1)).all()
    assert (apart[rows, others] == apart[:, others].min(axis=0)).all()
    # Who could be matched alone is.
    sole = (apart <= within) & ((apart <= within).sum(axis=1) == 1)[:, None]
    sole &= ((apart <= within).sum(axis=0) == 1)[None]
    assert set(zip(*np.nonzero(sole), strict=True)) <= set(zip(rows, others, strict=True))
