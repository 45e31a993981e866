"""The file of a camera's estimates: what was written comes back, anything else is refused."""

from __future__ import annotations

import io
import pickle
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_models.errors import BadInput
from glovecal_models.takes.camera_estimates import (
    CameraEstimates,
    read_estimates,
    without_repeats,
    write_estimates,
)


def estimates(frames: int = 20) -> CameraEstimates:
    random = np.random.default_rng(0)
    angles = random.uniform(0, 90, (frames, 2))
    angles[3] = np.nan
    accepted = random.random((frames, 2)) < 0.5
    accepted[3] = False
    return CameraEstimates(
        np.arange(frames) / 30, ("I_MCP", "I_PIP"), angles, np.full((frames, 2), 2.0), accepted,
        np.full(frames, 9), simulated=True,
    )  # fmt: skip


def test_what_was_written_comes_back(tmp_path: Path):
    written = estimates()
    write_estimates(written, tmp_path / "e.npz")
    read = read_estimates(tmp_path / "e.npz")
    for name in ("time_s", "angles_deg", "sd_deg", "accepted", "patches"):
        np.testing.assert_array_equal(getattr(read, name), getattr(written, name))
    assert (read.rotations, read.simulated) == (written.rotations, True)
    assert not list(tmp_path.glob("*.part"))


def test_frames_stamped_twice_are_left_out(tmp_path: Path):
    np.testing.assert_array_equal(without_repeats(np.array([0, 1, 1, 0.5, 2])), [1, 1, 0, 0, 1])
    write_estimates(estimates(), tmp_path / "e.npz")
    with np.load(tmp_path / "e.npz") as archive:
        arrays = dict(archive)
    arrays["time_s"][5] = arrays["time_s"][4]
    np.savez(tmp_path / "twice.npz", **arrays)
    assert len(read_estimates(tmp_path / "twice.npz").time_s) == 19


class Trap:
    """Runs when it is unpickled."""

    def __reduce__(self):
        return pytest.fail, ("something was unpickled",)


@pytest.mark.parametrize("kind", ["pickle", "object array", "text", "empty", "half", "other arrays"])
def test_other_files_are_refused_and_nothing_is_unpickled(tmp_path: Path, kind: str):
    file = tmp_path / "e.npz"
    write_estimates(estimates(), file)
    content = file.read_bytes()
    if kind == "object array":
        arrays: dict[str, Any] = {
            name: np.zeros(1) for name in ("time_s", "sd_deg", "accepted", "patches", "version")
        }
        np.savez(file, angles_deg=np.array([Trap()]), rotations=np.array(["A"]), simulated=True, **arrays)
    elif kind == "other arrays":
        np.savez(file, time_s=np.zeros(3))
    else:
        bodies = {"pickle": pickle.dumps(Trap()), "text": b"time_s\n0\n", "empty": b"", "half": content[:400]}
        file.write_bytes(bodies[kind])
    with pytest.raises(BadInput, match=r"e\.npz"):
        read_estimates(file)


def test_an_archive_that_would_unpack_too_large_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    write_estimates(estimates(2000), tmp_path / "e.npz")
    size = (tmp_path / "e.npz").stat().st_size
    monkeypatch.setattr("glovecal_models.takes.camera_estimates.LARGEST_ESTIMATES", size)
    monkeypatch.setattr("numpy.load", lambda *_, **__: pytest.fail("unpacked"))
    with pytest.raises(BadInput, match=f"of {size} bytes at most"):
        read_estimates(tmp_path / "e.npz")


@settings(max_examples=60)
@given(st.binary(max_size=300), st.integers(0, 3000))
def test_damaged_files_are_refused_or_read_whole(tmp_path_factory, noise: bytes, place: int):
    folder = tmp_path_factory.mktemp("e")
    write_estimates(estimates(), folder / "e.npz")
    content = bytearray((folder / "e.npz").read_bytes())
    content[place : place + len(noise)] = noise
    (folder / "e.npz").write_bytes(content)
    with suppress(BadInput):
        assert np.isfinite(read_estimates(folder / "e.npz").time_s).all()


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"sd_deg": np.zeros((20, 2))}, "the deviation positive"),
        ({"time_s": np.zeros(20)}, "time must increase"),
        ({"rotations": ("I_MCP", "I_MCP")}, "stands twice"),
        ({"patches": np.zeros(3)}, "patches has shape"),
        ({"angles_deg": np.full((20, 2), 1000.0)}, "exceeds 360 degrees"),
    ],
)
def test_estimates_that_cannot_be_are_refused(change, problem):
    with pytest.raises(BadInput, match=problem):
        replace(estimates(), **change)


def test_a_file_of_a_later_version_is_refused(tmp_path: Path):
    write_estimates(estimates(), tmp_path / "e.npz")
    with np.load(tmp_path / "e.npz") as archive:
        arrays: dict[str, Any] = dict(archive)
    stream = io.BytesIO()
    later: dict[str, Any] = arrays | {"version": np.array(2)}
    np.savez(stream, **later)
    (tmp_path / "e.npz").write_bytes(stream.getvalue())
    with pytest.raises(BadInput, match="another version"):
        read_estimates(tmp_path / "e.npz")


def test_poses_of_a_camera_become_estimates():
    from glovecal_models.colour_glove.hand_state import HandState, PoseEstimate, camera_estimates

    state = HandState(np.arange(20.0), np.eye(3), np.array([0.0, 0.0, 400.0]))
    sure = np.arange(20) < 5
    pose = PoseEstimate(state, np.full(26, 2.0), sure, (1, 2, 7), 0.1, "dense")
    found = camera_estimates([0.0, 0.03, 0.03, 0.1], [pose, None, pose, pose], simulated=True)
    np.testing.assert_array_equal(found.time_s, [0.0, 0.03, 0.1])
    np.testing.assert_array_equal(found.accepted, [sure, np.zeros(20, bool), sure])
    np.testing.assert_array_equal(found.patches, [3, 0, 3])
    assert np.isnan(found.angles_deg[1]).all()
    np.testing.assert_array_equal(found.angles_deg[2], state.angles_deg)
