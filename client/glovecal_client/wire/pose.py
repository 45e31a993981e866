"""Pose, version 1: calibrated rotations with their uncertainty (layout in README.md)."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntFlag

import numpy as np

from glovecal_client.errors import WireError
from glovecal_client.wire.frame import CHECKSUM_BYTES, check_seal, sealed

POSE_ENCODING = "application/octet-stream;glovecal.pose.v1"
MAX_ROTATIONS = 1024

_MAGIC = b"GLVP"
_VERSION = 1
_HEAD = struct.Struct("<4sBBHQqqQQII32s")
_NO_MODEL = bytes(32)
MAX_POSE_BYTES = _HEAD.size + 9 * MAX_ROTATIONS + CHECKSUM_BYTES


class PoseFlag(IntFlag):
    """Bits of a pose's flags; a reader ignores bits it does not know."""

    UNCALIBRATED = 1
    STALE = 2
    EXTRAPOLATING = 4
    TOO_UNCERTAIN = 8
    STATE_RESET = 16
    SIMULATED = 32
    SETTLING = 64
    FAULTY_SENSOR = 128


class RotationFlag(IntFlag):
    """Bits of one rotation's flags."""

    EXTRAPOLATING = 1
    TOO_UNCERTAIN = 2
    BY_RULE = 4
    FAULTY_SENSOR = 8


UNUSABLE = RotationFlag.TOO_UNCERTAIN | RotationFlag.FAULTY_SENSOR
"""Flags of a rotation whose angle is not to be used."""


def _no_values() -> np.ndarray:
    return np.empty(0, np.float32)


def _no_flags() -> np.ndarray:
    return np.empty(0, np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Calibrated rotations made from one frame. An uncalibrated pose has no rotations."""

    sequence: int
    """Sequence number of the source frame."""
    run_id: int
    monotonic_ns: int
    """Time of the hand by the capture computer's monotonic clock: that of the source frame less the glove's
    known latency (``pose/meta``: ``glove_latency_s``)."""
    wall_ns: int
    """The same by its wall clock."""
    degrees: np.ndarray = field(default_factory=_no_values)
    """Rotations in degrees, float32, shape (R,), in the order given by ``pose/meta``."""
    deviations: np.ndarray = field(default_factory=_no_values)
    """Standard deviation of each rotation in degrees, float32, shape (R,)."""
    rotation_flags: np.ndarray = field(default_factory=_no_flags)
    """RotationFlag bits, uint8, shape (R,)."""
    model_sha256: str | None = None
    """64 hexadecimal digits naming the calibration model, None if there is none."""
    flags: int = 0
    """PoseFlag bits."""
    skipped: int = 0
    """Frames of this run that the service has skipped so far."""
    age_us: int = 0
    """Microseconds from the service's receipt of the frame to publication, plus the glove's known latency."""
    term: int = 0
    """Of the process that made it, higher with each process that took the glove over; 0: it does not say."""

    @property
    def words(self) -> tuple[str, ...]:
        """The flags in words, such as ``("uncalibrated", "simulated")``; unknown bits have none."""
        return tuple((flag.name or "").lower().replace("_", " ") for flag in PoseFlag if self.flags & flag)

    @property
    def usable(self) -> np.ndarray:
        """(R,) bool: neither too uncertain nor held because a sensor fails."""
        return (self.rotation_flags & UNUSABLE) == 0

    @property
    def uncalibrated(self) -> bool:
        return bool(self.flags & PoseFlag.UNCALIBRATED)

    @property
    def stale(self) -> bool:
        return bool(self.flags & PoseFlag.STALE)

    @property
    def extrapolating(self) -> bool:
        return bool(self.flags & PoseFlag.EXTRAPOLATING)

    @property
    def too_uncertain(self) -> bool:
        return bool(self.flags & PoseFlag.TOO_UNCERTAIN)

    @property
    def state_reset(self) -> bool:
        """An effect with a memory started anew with this frame: new run or wearing, gap, other model."""
        return bool(self.flags & PoseFlag.STATE_RESET)

    @property
    def settling(self) -> bool:
        """An effect with a memory runs for shorter than its longest time constant; it corrects less well."""
        return bool(self.flags & PoseFlag.SETTLING)

    @property
    def faulty_sensor(self) -> bool:
        """Some rotation's sensor fails now: that rotation keeps its last good angle."""
        return bool(self.flags & PoseFlag.FAULTY_SENSOR)

    @property
    def simulated(self) -> bool:
        return bool(self.flags & PoseFlag.SIMULATED)


def encode_pose(pose: Pose) -> bytes:
    """The pose as bytes. Raises WireError where a value does not fit the format."""
    degrees = np.asarray(pose.degrees, dtype="<f4")
    deviations = np.asarray(pose.deviations, dtype="<f4")
    rotation_flags = np.asarray(pose.rotation_flags, dtype=np.uint8)
    (rotations,) = encode_rotations(degrees[None], deviations[None], rotation_flags[None])
    return encode_around(
        rotations, pose.sequence, pose.run_id, pose.monotonic_ns, pose.wall_ns,
        model_bytes(pose.model_sha256), pose.flags, pose.skipped, pose.age_us, pose.term,
    )  # fmt: skip


def encode_rotations(
    degrees: np.ndarray, deviations: np.ndarray, rotation_flags: np.ndarray
) -> Sequence[bytes]:
    """What stands in N messages from degrees to rotations' flags, from arrays (N, R), float32 and uint8.

    Raises WireError as ``encode_pose`` does.
    """
    _check_values(degrees, deviations, rotation_flags)
    parts = [np.ascontiguousarray(part).view(np.uint8) for part in (degrees, deviations, rotation_flags)]
    joined, length = np.concatenate(parts, axis=1).tobytes(), 9 * degrees.shape[1]
    return [joined[at * length : (at + 1) * length] for at in range(len(degrees))]


def encode_around(
    rotations: bytes, sequence: int, run_id: int, monotonic_ns: int, wall_ns: int,
    model: bytes, flags: int, skipped: int, age_us: int, term: int = 0,
) -> bytes:  # fmt: skip
    """A message around ``rotations``, one of those that ``encode_rotations`` gave.

    ``model`` is what ``model_bytes`` gave, the others are named as in ``Pose``. Raises WireError where a
    number does not fit its field.
    """
    try:
        head = _HEAD.pack(
            _MAGIC, _VERSION, flags, len(rotations) // 9, sequence, monotonic_ns, wall_ns, run_id,
            skipped, age_us, term, model,
        )  # fmt: skip
    except struct.error as error:
        raise WireError(f"pose {sequence}: a number does not fit its field") from error
    return sealed(head + rotations)


def decode_pose(message: bytes) -> Pose:
    """The pose in ``message``. Raises WireError if it is not exactly one whole, undamaged pose."""
    if len(message) < _HEAD.size + CHECKSUM_BYTES:
        raise WireError(
            f"pose: cut short, {len(message)} bytes; the smallest has {_HEAD.size + CHECKSUM_BYTES}"
        )
    head = _HEAD.unpack_from(message)
    magic, version, flags, count, sequence, monotonic_ns, wall_ns, run_id, skipped, age_us, term, model = head
    if magic != _MAGIC:
        raise WireError(f"pose: starts with {magic!r}, not {_MAGIC!r}")
    if version != _VERSION:
        raise WireError(f"pose: version {version}; this software reads version {_VERSION}")
    expected = _HEAD.size + 9 * count + CHECKSUM_BYTES
    if len(message) != expected:
        raise WireError(f"pose: {len(message)} bytes, but {count} rotations need {expected}")
    check_seal(message, "pose")
    degrees = np.frombuffer(message, "<f4", count, _HEAD.size)
    deviations = np.frombuffer(message, "<f4", count, _HEAD.size + 4 * count)
    rotation_flags = np.frombuffer(message, np.uint8, count, _HEAD.size + 8 * count)
    _check_values(degrees[None], deviations[None], rotation_flags[None])
    return Pose(
        sequence, run_id, monotonic_ns, wall_ns, degrees, deviations, rotation_flags,
        None if model == _NO_MODEL else model.hex(), flags, skipped, age_us, term,
    )  # fmt: skip


def model_bytes(sha256: str | None) -> bytes:
    """The 32 bytes that name a model in a message. Raises WireError for what is no sha256."""
    if sha256 is None:
        return _NO_MODEL
    try:
        digest = bytes.fromhex(sha256)
    except ValueError:
        digest = b""
    if len(digest) != 32 or digest == _NO_MODEL:
        raise WireError(f"pose: model {sha256!r} is not a sha256 (64 hexadecimal digits)")
    return digest


def _check_values(degrees: np.ndarray, deviations: np.ndarray, rotation_flags: np.ndarray) -> None:
    """All (N, R)."""
    if degrees.ndim != 2 or degrees.shape[1] > MAX_ROTATIONS:
        shape = degrees.shape[1:]
        raise WireError(f"pose: degrees of shape {shape}; allowed are 0 to {MAX_ROTATIONS} rotations")
    if deviations.shape != degrees.shape or rotation_flags.shape != degrees.shape:
        raise WireError(
            f"pose: {degrees.shape[1]} rotations, deviations {deviations.shape[1:]}, "
            f"flags {rotation_flags.shape[1:]}"
        )
    if not (np.isfinite(degrees).all() and np.isfinite(deviations).all()):
        raise WireError("pose: a rotation or its deviation is NaN or infinite; send no rotations instead")
    if (deviations < 0).any():
        raise WireError("pose: a standard deviation is negative")
