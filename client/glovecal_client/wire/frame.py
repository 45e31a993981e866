"""Frame, version 1: one set of raw readings on the wire and in the log (layout in README.md).

The last four bytes of every message are the CRC-32 (zlib, IEEE 802.3) of all bytes before, little-endian.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from enum import IntFlag

import numpy as np

from glovecal_client.errors import WireError

CHECKSUM_BYTES = 4
_CHECKSUM = struct.Struct("<I")


def sealed(body: bytes) -> bytes:
    """``body`` with its checksum appended."""
    return body + _CHECKSUM.pack(zlib.crc32(body))


def check_seal(message: bytes, what: str) -> None:
    """Raise WireError unless the last four bytes are the checksum of the others."""
    at = len(message) - CHECKSUM_BYTES
    (stated,) = _CHECKSUM.unpack_from(message, at)
    found = zlib.crc32(memoryview(message)[:at])
    if stated != found:
        raise WireError(f"{what}: damaged, its bytes have CRC {found:08x} but it states {stated:08x}")


FRAME_ENCODING = "application/octet-stream;glovecal.frame.v1"
MAX_SENSORS = 1024
MAX_CONTEXT = 256

_MAGIC = b"GLVF"
_VERSION = 1
_HEAD = struct.Struct("<4sBBHQqqQHH")
_SEQUENCE = struct.Struct("<Q")
_SEQUENCE_AT = 8
_RUN_ID_AT = 32
RUN_ID_BYTES = slice(_RUN_ID_AT, _RUN_ID_AT + 8)
"""Of a message: equal for all frames of a run."""
MAX_FRAME_BYTES = _HEAD.size + 4 * (MAX_SENSORS + MAX_CONTEXT) + CHECKSUM_BYTES


class FrameFlag(IntFlag):
    """Bits of a frame's flags; a reader ignores bits it does not know."""

    BUTTON = 1
    SIMULATED = 2
    REPAIRED = 4


_NOTHING = np.empty(0, np.float32)


def _no_values() -> np.ndarray:
    return _NOTHING


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One set of readings with its sequence number and times."""

    sequence: int
    """Counts from 0 in each run; u64."""
    run_id: int
    """Random number of one start of the capture daemon; u64."""
    monotonic_ns: int
    """Monotonic clock of the capture computer, nanoseconds; compare only inside one run."""
    wall_ns: int
    """Nanoseconds since 1970-01-01 UTC by the capture computer's clock."""
    readings: np.ndarray
    """Raw sensor values, float32, shape (S,), all finite."""
    context: np.ndarray = field(default_factory=_no_values)
    """Context values, float32, shape (C,); NaN where not measured."""
    flags: int = 0

    @property
    def button(self) -> bool:
        """The glove's button was down."""
        return bool(self.flags & FrameFlag.BUTTON)

    @property
    def simulated(self) -> bool:
        """The readings come from a simulation, not from a person."""
        return bool(self.flags & FrameFlag.SIMULATED)

    @property
    def repaired(self) -> bool:
        """The frame was fetched from the capture log after it was missed on the wire."""
        return bool(self.flags & FrameFlag.REPAIRED)


def encode_frame(frame: Frame) -> bytes:
    """The frame as bytes. Raises WireError where a value does not fit the format."""
    readings = np.asarray(frame.readings, dtype="<f4")
    context = np.asarray(frame.context, dtype="<f4")
    _check_values(readings, context)
    try:
        head = _HEAD.pack(
            _MAGIC, _VERSION, frame.flags, len(readings), frame.sequence, frame.monotonic_ns,
            frame.wall_ns, frame.run_id, len(context), 0,
        )  # fmt: skip
    except struct.error as error:
        raise WireError(f"frame {frame.sequence}: a number does not fit its field") from error
    return sealed(head + readings.tobytes() + context.tobytes())


def decode_frame(message: bytes) -> Frame:
    """The frame in ``message``. Raises WireError if it is not exactly one whole, undamaged frame."""
    if len(message) < _HEAD.size + CHECKSUM_BYTES:
        raise WireError(
            f"frame: cut short, {len(message)} bytes; the smallest has {_HEAD.size + CHECKSUM_BYTES}"
        )
    magic, version, flags, sensors, sequence, monotonic_ns, wall_ns, run_id, contexts, _ = _HEAD.unpack_from(
        message
    )
    if magic != _MAGIC:
        raise WireError(f"frame: starts with {magic!r}, not {_MAGIC!r}")
    if version != _VERSION:
        raise WireError(f"frame: version {version}; this software reads version {_VERSION}")
    expected = _HEAD.size + 4 * (sensors + contexts) + CHECKSUM_BYTES
    if len(message) != expected:
        raise WireError(
            f"frame: {len(message)} bytes, but {sensors} sensors and {contexts} context need {expected}"
        )
    check_seal(message, "frame")
    readings = np.frombuffer(message, "<f4", sensors, _HEAD.size)
    context = np.frombuffer(message, "<f4", contexts, _HEAD.size + 4 * sensors) if contexts else _NOTHING
    _check_values(readings, context)
    return Frame(sequence, run_id, monotonic_ns, wall_ns, readings, context, flags)


def frame_sequence(message: bytes) -> int:
    """The sequence number of a frame that is known to be whole, without decoding the rest."""
    return _SEQUENCE.unpack_from(message, _SEQUENCE_AT)[0]


def frame_run_id(message: bytes) -> int:
    """The run id of a frame that is known to be whole, without decoding the rest."""
    return _SEQUENCE.unpack_from(message, _RUN_ID_AT)[0]


def _check_values(readings: np.ndarray, context: np.ndarray) -> None:
    if readings.ndim != 1 or not 1 <= len(readings) <= MAX_SENSORS:
        raise WireError(f"frame: readings of shape {readings.shape}; allowed are 1 to {MAX_SENSORS} sensors")
    if context.ndim != 1 or len(context) > MAX_CONTEXT:
        raise WireError(f"frame: context of shape {context.shape}; allowed are 0 to {MAX_CONTEXT} values")
    finite = np.isfinite(readings)
    if not np.logical_and.reduce(finite):
        column = int(np.argmin(finite))
        raise WireError(f"frame: sensor {column} reads {readings[column]}; readings must be finite numbers")
    if len(context) and np.isinf(context).any():
        raise WireError("frame: a context value is infinite; write NaN for not measured")
