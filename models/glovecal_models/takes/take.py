"""A take: frames of raw readings, and reference angles and context where they were measured.

The measured latency of a glove: how long after the hand its frames are stamped.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.presentation.document import answer

LONGEST_INTERPOLATED_GAP_S = 0.1
"""A reference is interpolated between its own samples only when they are closer than this."""
Stretch = tuple[float, float]
"""From and to, seconds; both ends belong to it."""


@dataclass(frozen=True)
class KnownLatency:
    """What ``glovecal take latency`` measured."""

    seconds: float
    sd_s: float
    """Standard deviation of ``seconds``."""


@answer
class ReferenceJump:
    """Rows of one rotation's reference that stand apart from those before and after."""

    rotation: str
    start_s: float
    """Of the first of them, on the reference's clock."""
    end_s: float
    rows: int
    size_deg: float
    """How far away they are, degrees at most; of a step that stays, its height."""
    comes_back: bool
    """Then its angles are left out of training and of errors; else it is a step that stays, at the start."""


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
    reference_sd: np.ndarray | None = None
    """Standard deviation of each reference angle as its source states it, shape (R, len(rotations)), degrees;
    NaN where no angle was measured, and in whole columns that state none. None: nothing is stated."""
    excluded: tuple[ReferenceJump, ...] = ()
    """Angles that were measured and are NaN in ``reference``, as they jump away and come back."""
    left_out: tuple[Stretch, ...] = ()
    """Stretches by the take's clock whose frames and reference rows a person left out."""

    def __post_init__(self) -> None:
        frames, rows = len(self.time_s), len(self.reference_time_s)
        _require_shape("readings", self.readings, (frames, len(self.sensors)), self.name)
        _require_shape("reference", self.reference, (rows, len(self.rotations)), self.name)
        if self.reference_sd is not None:
            _require_shape("reference_sd", self.reference_sd, (rows, len(self.rotations)), self.name)
            problem = deviation_problem(self.rotations, self.reference, self.reference_sd)
            if problem is not None:
                raise BadInput(f"take {self.name!r}: {problem[1]}")
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
    def left_out_since_start(self) -> tuple[Stretch, ...]:
        """``left_out`` in seconds since the first frame that was recorded."""
        began = min([float(self.time_s[0]), *(low for low, _ in self.left_out)])
        return tuple((low - began, high - began) for low, high in self.left_out)

    @property
    def left_out_intervals(self) -> np.ndarray:
        """(N - 1,) whether frames were left out between each frame and the next."""
        after = np.searchsorted(self.time_s, [low for low, _ in self.left_out])
        result = np.zeros(max(len(self.time_s) - 1, 0), bool)
        result[[at - 1 for at in after if 0 < at < len(self.time_s)]] = True
        return result

    def some(self, frames: np.ndarray, rows: np.ndarray) -> Take:
        """Only these frames and rows of the reference: masks (N,) and (R,)."""
        return replace(
            self,
            time_s=self.time_s[frames],
            readings=self.readings[frames],
            reference_time_s=self.reference_time_s[rows],
            reference=self.reference[rows],
            reference_sd=None if self.reference_sd is None else self.reference_sd[rows],
            context={name: column[frames] for name, column in self.context.items()},
            poses=self.poses and tuple(self.poses[at] for at in np.flatnonzero(frames)),
        )

    def without(self, stretches: Sequence[Stretch]) -> Take:
        """Without what lies in ``stretches``, seconds since the first frame and not before it: as if the
        glove had sent nothing there, so that an effect with a memory meets a pause."""
        if not stretches:
            return self
        began = float(self.time_s[0])
        left_out = tuple((began + low, began + high) for low, high in sorted(stretches))
        kept = self.some(_outside(self.time_s, left_out), _outside(self.reference_time_s, left_out))
        return replace(kept, left_out=left_out)

    @property
    def has_own_reference_clock(self) -> bool:
        return not np.array_equal(self.time_s, self.reference_time_s)

    def reference_at_frames(self, rotations: Sequence[str]) -> np.ndarray:
        """Reference angles at the frame times, shape (N, len(rotations)), NaN where none was measured.

        With a time column of its own the reference is interpolated linearly, never extrapolated and
        never across a gap longer than ``LONGEST_INTERPOLATED_GAP_S``, and never in the pre-roll. Where
        standard deviations are stated, a row without an angle is a gap, too: it was seen and not accepted.
        """
        return self._at_frames(self.reference, rotations)

    def reference_sd_at_frames(self, rotations: Sequence[str]) -> np.ndarray | None:
        """Stated standard deviations at the frame times, shape (N, len(rotations)), degrees; NaN where none
        is stated. None where the take states none at all."""
        return None if self.reference_sd is None else self._at_frames(self.reference_sd, rotations)

    def reference_between(self, at: np.ndarray, values: np.ndarray) -> np.ndarray:
        """A column of the reference (R,), or of its deviations, at times (M,): as ``reference_at_frames``."""
        measured = np.flatnonzero(np.isfinite(values))
        if len(measured) < 2:
            return np.full(len(at), np.nan)
        time = self.reference_time_s[measured]
        after = np.clip(np.searchsorted(time, at), 1, len(time) - 1)
        usable = (at >= time[0]) & (at <= time[-1])
        usable &= time[after] - time[after - 1] <= LONGEST_INTERPOLATED_GAP_S
        if self.reference_sd is not None:
            usable &= measured[after] - measured[after - 1] == 1
        return np.where(usable, np.interp(at, time, values[measured]), np.nan)

    def _at_frames(self, table: np.ndarray, rotations: Sequence[str]) -> np.ndarray:
        """Columns of ``table``, rows of the reference, as ``reference_at_frames`` reads it."""
        result = np.full((len(self.time_s), len(rotations)), np.nan)
        for column, rotation in enumerate(rotations):
            if rotation not in self.rotations:
                continue
            values = table[:, self.rotations.index(rotation)]
            if self.has_own_reference_clock:
                values = self.reference_between(self.time_s, values)
            result[:, column] = values
        result[: self.pre_roll_frames] = np.nan
        return result


def _outside(time_s: np.ndarray, stretches: Sequence[Stretch]) -> np.ndarray:
    inside = [(time_s >= low) & (time_s <= high) for low, high in stretches]
    return ~np.any(inside, axis=0)


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


def deviation_problem(
    rotations: Sequence[str], reference: np.ndarray, deviations: np.ndarray
) -> tuple[int, str] | None:
    """Row and sentence of the first stated deviation (R, rotations) that cannot be, None if all can.

    A column states the deviation of each of its angles, or of none.
    """
    for column, rotation in enumerate(rotations):
        stated = deviations[:, column]
        if np.isnan(stated).all():
            continue
        bad = np.isfinite(reference[:, column]) & ~((stated > 0) & np.isfinite(stated))
        if bad.any():
            row = int(np.argmax(bad))
            return row, (
                f"the standard deviation of {rotation} is {stated[row]:g} in row {row + 1}; where an angle "
                "is measured it must be positive degrees, in all of its rows or in none"
            )
    return None


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
