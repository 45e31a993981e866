"""A take: frames of raw readings, and reference angles and context where they were measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.takes.known_latency import KnownLatency

LONGEST_INTERPOLATED_GAP_S = 0.1
"""A reference is interpolated between its own samples only when they are closer than this."""


@dataclass(frozen=True)
class Take:
    """A continuous recording inside one wearing.

    Frames and reference keep their own time columns: they may come from different clocks or rates.
    Nothing is resampled here; ``reference_at_frames`` interpolates when a caller needs pairs.
    """

    name: str
    wearing: str
    sensors: tuple[str, ...]
    time_s: np.ndarray
    """Frame times, shape (N,), seconds of any origin, increasing."""
    readings: np.ndarray
    """Raw readings, shape (N, len(sensors)), counts or volts as the glove sends them."""
    rotations: tuple[str, ...] = ()
    reference_time_s: np.ndarray = field(default_factory=lambda: np.empty(0))
    """Times of the reference rows, shape (R,), seconds."""
    reference: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    """Reference angles, shape (R, len(rotations)), degrees; NaN where not measured."""
    context: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Context columns at the frame times, each shape (N,); NaN where not measured."""
    poses: tuple[str, ...] | None = None
    """A pose name for each frame ("" for none), or None when the take has no pose column."""
    simulated: bool = False
    begins_s: float | None = None
    """Frames before this time are a pre-roll: recorded before the take was asked for, they tell effects with
    a memory where they stand. No reference is read there, as other takes may hold the same frames. None: all
    frames are asked for."""
    glove_latency: KnownLatency | None = None
    """How late the glove's frames are known to be, against the hand; ``time_s`` is as they were stamped."""

    def __post_init__(self) -> None:
        frames, rows = len(self.time_s), len(self.reference_time_s)
        _require_shape("readings", self.readings, (frames, len(self.sensors)), self.name)
        _require_shape("reference", self.reference, (rows, len(self.rotations)), self.name)
        for name, column in self.context.items():
            _require_shape(f"context {name}", column, (frames,), self.name)
        if self.poses is not None and len(self.poses) != frames:
            raise BadInput(f"take {self.name!r}: {len(self.poses)} pose names for {frames} frames")
        _require_increasing("time_s", self.time_s, self.name)
        _require_increasing("reference_time_s", self.reference_time_s, self.name)
        if not np.isfinite(self.readings).all():
            raise BadInput(
                f"take {self.name!r}: readings hold NaN or infinity; every frame needs finite values"
            )

    @property
    def duration_s(self) -> float:
        return float(self.time_s[-1] - self.time_s[0]) if len(self.time_s) > 1 else 0.0

    @property
    def start_s(self) -> float:
        """The time of the first frame that was asked for; a take has at least one frame."""
        first = float(self.time_s[0])
        return first if self.begins_s is None else max(first, self.begins_s)

    @property
    def pre_roll_frames(self) -> int:
        return 0 if self.begins_s is None else int(np.searchsorted(self.time_s, self.begins_s))

    @property
    def has_own_reference_clock(self) -> bool:
        return not np.array_equal(self.time_s, self.reference_time_s)

    def reference_at_frames(self, rotations: Sequence[str]) -> np.ndarray:
        """Reference angles at the frame times, shape (N, len(rotations)), NaN where none was measured.

        With a time column of its own the reference is interpolated linearly, never extrapolated and
        never across a gap longer than ``LONGEST_INTERPOLATED_GAP_S``, and never in the pre-roll.
        """
        result = np.full((len(self.time_s), len(rotations)), np.nan)
        for column, rotation in enumerate(rotations):
            if rotation not in self.rotations:
                continue
            values = self.reference[:, self.rotations.index(rotation)]
            if self.has_own_reference_clock:
                values = _interpolate(self.time_s, self.reference_time_s, values)
            result[:, column] = values
        result[: self.pre_roll_frames] = np.nan
        return result


def _interpolate(at: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    measured = np.isfinite(values)
    time, values = time[measured], values[measured]
    if len(time) < 2:
        return np.full(len(at), np.nan)
    after = np.clip(np.searchsorted(time, at), 1, len(time) - 1)
    usable = (at >= time[0]) & (at <= time[-1])
    usable &= time[after] - time[after - 1] <= LONGEST_INTERPOLATED_GAP_S
    return np.where(usable, np.interp(at, time, values), np.nan)


def _require_shape(what: str, array: np.ndarray, shape: tuple[int, ...], take: str) -> None:
    if array.shape != shape:
        raise BadInput(f"take {take!r}: {what} has shape {array.shape}, expected {shape}")


def _require_increasing(what: str, time: np.ndarray, take: str) -> None:
    if not np.isfinite(time).all():
        raise BadInput(f"take {take!r}: {what} holds NaN or infinity")
    back = np.flatnonzero(np.diff(time) <= 0)
    if len(back):
        row = int(back[0])
        raise BadInput(
            f"take {take!r}: {what} must increase, "
            f"but row {row + 1} is {time[row + 1]:g} s after {time[row]:g} s"
        )


def poses_at_frames(
    time_s: np.ndarray, pose_time_s: np.ndarray, poses: Sequence[str]
) -> tuple[str, ...] | None:
    """The pose named by the latest reference row at or before each frame, "" before the first.

    ``time_s`` (N,) and ``pose_time_s`` (R,) are seconds of one clock; None when no frame has a pose.
    """
    index = np.searchsorted(pose_time_s, time_s, side="right") - 1
    names = ["", *poses]
    named = tuple(names[i + 1] for i in index.tolist())
    return named if any(named) else None
