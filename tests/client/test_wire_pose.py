"""Poses on the wire: the golden file, round trips, and damage that must be refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glovecal_client import Pose, PoseFlag, RotationFlag, WireError, decode_pose, encode_pose
from glovecal_client.wire.pose import MAX_POSE_BYTES

GOLDEN = Path(__file__).parent / "golden"
VALUES = json.loads((GOLDEN / "pose_v1.json").read_text())
MESSAGE = (GOLDEN / "pose_v1.bin").read_bytes()
SCALARS = ("sequence", "run_id", "monotonic_ns", "wall_ns", "flags", "skipped", "age_us", "model_sha256")
ARRAYS = ("degrees", "deviations", "rotation_flags")


@st.composite
def poses(draw: st.DrawFn) -> Pose:
    count = draw(st.integers(0, 30))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return Pose(
        sequence=draw(st.integers(0, 2**64 - 1)),
        run_id=draw(st.integers(0, 2**64 - 1)),
        monotonic_ns=draw(st.integers(-(2**63), 2**63 - 1)),
        wall_ns=draw(st.integers(-(2**63), 2**63 - 1)),
        degrees=random.normal(scale=90, size=count).astype(np.float32),
        deviations=random.exponential(size=count).astype(np.float32),
        rotation_flags=random.integers(0, 8, count).astype(np.uint8),
        model_sha256=draw(st.none() | st.binary(min_size=32, max_size=32).filter(any).map(bytes.hex)),
        flags=draw(st.integers(0, 255)),
        skipped=draw(st.integers(0, 2**64 - 1)),
        age_us=draw(st.integers(0, 2**32 - 1)),
    )


def test_golden_pose_is_read_and_written_to_the_byte() -> None:
    pose = decode_pose(MESSAGE)
    for name in SCALARS:
        assert getattr(pose, name) == VALUES[name]
    for name in ARRAYS:
        assert getattr(pose, name).tolist() == VALUES[name]
    assert (pose.extrapolating, pose.too_uncertain, pose.simulated) == (True, True, True)
    assert (pose.uncalibrated, pose.stale, pose.state_reset) == (False, False, False)
    assert not pose.settling
    assert pose.words == ("extrapolating", "too uncertain", "simulated")
    assert Pose(0, 0, 0, 0, flags=35 | 1 << 15).words == ("uncalibrated", "stale", "simulated")
    arrays = {name: np.array(VALUES[name]) for name in ARRAYS}
    assert encode_pose(Pose(**(VALUES | arrays))) == MESSAGE


def test_golden_settling_pose_is_read_and_written_to_the_byte() -> None:
    message = (GOLDEN / "pose_v1_settling.bin").read_bytes()
    values = json.loads((GOLDEN / "pose_v1_settling.json").read_text())
    pose = decode_pose(message)
    assert (pose.state_reset, pose.settling, pose.simulated, pose.stale) == (True, True, False, False)
    assert encode_pose(Pose(**(values | {name: np.array(values[name]) for name in ARRAYS}))) == message


def test_golden_pose_of_a_faulty_sensor_is_read_and_written_to_the_byte() -> None:
    message = (GOLDEN / "pose_v1_faulty.bin").read_bytes()
    values = json.loads((GOLDEN / "pose_v1_faulty.json").read_text())
    pose = decode_pose(message)
    assert (pose.faulty_sensor, pose.too_uncertain, pose.settling) == (True, True, False)
    assert [bool(flags & RotationFlag.FAULTY_SENSOR) for flags in pose.rotation_flags] == [True, False, True]
    assert encode_pose(Pose(**(values | {name: np.array(values[name]) for name in ARRAYS}))) == message


@given(poses())
def test_what_is_written_is_read_back(pose: Pose) -> None:
    message = encode_pose(pose)
    assert len(message) == 92 + 9 * len(pose.degrees) <= MAX_POSE_BYTES
    again = decode_pose(message)
    for name in SCALARS:
        assert getattr(again, name) == getattr(pose, name)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(again, name), getattr(pose, name))


def test_every_truncation_is_refused() -> None:
    for length in range(len(MESSAGE)):
        with pytest.raises(WireError):
            decode_pose(MESSAGE[:length])


def test_every_flipped_bit_is_refused() -> None:
    for bit in range(8 * len(MESSAGE)):
        damaged = bytearray(MESSAGE)
        damaged[bit // 8] ^= 1 << bit % 8
        with pytest.raises(WireError):
            decode_pose(bytes(damaged))


@given(st.binary(max_size=200))
def test_arbitrary_bytes_are_refused_with_a_sentence(message: bytes) -> None:
    with pytest.raises(WireError, match=r"^pose: .*\w"):
        decode_pose(message)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"degrees": np.array([np.nan])}, "NaN or infinite"),
        ({"deviations": np.array([np.inf])}, "NaN or infinite"),
        ({"deviations": np.array([-0.1])}, "negative"),
        ({"deviations": np.array([1.0, 2.0])}, "1 rotations, deviations"),
        ({"rotation_flags": np.array([], np.uint8)}, "flags"),
        ({"model_sha256": "abc"}, "not a sha256"),
        ({"model_sha256": "00" * 32}, "not a sha256"),
        ({"age_us": 2**32}, "does not fit"),
        ({"skipped": -1}, "does not fit"),
    ],
)
def test_values_outside_the_format_are_refused(change: dict, sentence: str) -> None:
    one = {"degrees": np.ones(1), "deviations": np.ones(1), "rotation_flags": np.zeros(1, np.uint8)}
    values: dict[str, Any] = {"sequence": 0, "run_id": 0, "monotonic_ns": 0, "wall_ns": 0} | one
    with pytest.raises(WireError, match=sentence):
        encode_pose(Pose(**(values | change)))


def test_flag_bits_are_those_of_the_document() -> None:
    assert [int(flag) for flag in PoseFlag] == [1, 2, 4, 8, 16, 32, 64, 128]
    assert [int(flag) for flag in RotationFlag] == [1, 2, 4, 8]
