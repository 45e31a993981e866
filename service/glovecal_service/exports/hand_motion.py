"""One hand's motion as an export writes it, two hands on one time, and what an export format is."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.skeleton import Skeleton
from glovecal_service.exports.body_markers import HandFrame, Wrist

Content = Literal["joints", "angles", "raw"]
"""Places of joints in mm, calibrated rotations in degrees, or readings as the glove sent them."""
CONTENTS: tuple[Content, ...] = get_args(Content)
BRIDGED_S = 0.1
"""Across longer gaps nothing is interpolated."""
SAME_S = 1e-6
FRAMES_AT_ONCE = 4096


ALL_CHANNELS, NO_ROOM = "standard deviations and flags", "nothing: it has no room for them"
"""What a format holds beside the angles."""
NOT_KNOWN = -1.0
"""Where a format has numbers only: neither a deviation nor flags are ever negative."""


@dataclass(frozen=True)
class Channel:
    """What travels beside a hand's angles: a number a frame and rotation."""

    name: str
    unit: str
    """Empty for flags."""
    values: np.ndarray
    """(N, R); NaN where not known."""

    @property
    def key(self) -> str:
        """Name and unit."""
        return f"{self.name}_{self.unit}" if self.unit else self.name

    @property
    def is_held(self) -> bool:
        """Bits, between which nothing is interpolated."""
        return self.values.dtype.kind != "f"

    @property
    def numbers(self) -> np.ndarray:
        """(N, R) without a NaN."""
        return self.values if self.is_held else np.nan_to_num(self.values, nan=NOT_KNOWN)


@dataclass(frozen=True)
class HandMotion:
    """N frames of one hand, of S sensors and R calibrated rotations."""

    label: str
    """Begins the names of what is written: "R", "L"."""
    time_s: np.ndarray
    """(N,), seconds of the recording's clock, increasing."""
    sensors: tuple[str, ...]
    readings: np.ndarray
    """(N, S), raw."""
    rotations: tuple[str, ...]
    """Empty for a take without a model: then only readings can be written."""
    degrees: np.ndarray
    """(N, R); NaN where a rotation is not known."""
    sd_deg: np.ndarray
    """(N, R); NaN where none is stated."""
    skeleton: Skeleton
    simulated: bool = False
    flags: np.ndarray | None = None
    """(N, R) of each rotation, bits as in a live pose; None where there are none."""
    measured: bool = False
    """The angles are a reference, not a model's."""
    notes: Mapping[str, Any] = field(default_factory=dict)
    """What it was made of and how, for formats that can say it."""
    frame: HandFrame | None = None
    """Where the hand is, if an optical system saw it; else joints are in the forearm's frame."""
    wrist: Wrist = "glove"
    """With "optical" the glove's wrist angles are ignored: the frame is that of the hand itself."""
    beside: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Other markers, (N, 3) by name, mm, to be written with the hand."""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Beside the angles, for formats that can hold them."""
        deviations = Channel("sd", "deg", self.sd_deg)
        return (deviations,) if self.flags is None else (deviations, Channel("flags", "", self.flags))

    def frames(self, which: slice) -> HandMotion:
        """Some of the frames."""
        return replace(
            self, time_s=self.time_s[which], readings=self.readings[which], degrees=self.degrees[which],
            sd_deg=self.sd_deg[which],
            flags=None if self.flags is None else self.flags[which],
            frame=None if self.frame is None else self.frame.frames(which),
            beside={name: places[which] for name, places in self.beside.items()},
        )  # fmt: skip

    def require_angles(self, content: Content) -> None:
        """Raises BadInput where nothing is calibrated."""
        if not self.rotations:
            raise BadInput(
                f"{content} need a model, or measured angles; without them a take has raw readings only"
            )


def blocks(count: int) -> Iterator[slice]:
    """So many frames, ``FRAMES_AT_ONCE`` at a time: what is written of an hour takes no more memory than what
    is written of a minute. One block at least."""
    for begin in range(0, max(count, 1), FRAMES_AT_ONCE):
        yield slice(begin, min(begin + FRAMES_AT_ONCE, count))


def on_one_time(motions: Sequence[HandMotion], shifts_s: Sequence[float] = ()) -> tuple[HandMotion, ...]:
    """All hands at the frames of the first, where every one was recorded.

    ``shifts_s``: added to the times of each; takes of one capture computer have one clock and need none.
    Readings are those of the nearest frame, never a mean of two; angles are interpolated. Raises BadInput
    when there is no moment that all have.
    """
    shifts_s = shifts_s or [0.0] * len(motions)
    moved = [replace(one, time_s=one.time_s + by) for one, by in zip(motions, shifts_s, strict=True)]
    begin, end = max(one.time_s[0] for one in moved), min(one.time_s[-1] for one in moved)
    first = moved[0].time_s
    at = first[(first >= begin) & (first <= end)]
    if not len(at):
        spans = ", ".join(f"{one.label} {one.time_s[0]:.1f} to {one.time_s[-1]:.1f} s" for one in moved)
        raise BadInput(
            f"the takes have no moment in common ({spans}); shift one of them onto the other's clock"
        )
    return tuple(at_times(one, at) for one in moved)


def at_times(motion: HandMotion, at: np.ndarray) -> HandMotion:
    """At other times (M,) inside the recording: angles interpolated, NaN in gaps; the nearest readings."""
    time = motion.time_s
    if np.array_equal(at, time):
        return motion
    after = np.clip(np.searchsorted(time, at), 1, len(time) - 1) if len(time) > 1 else np.zeros(len(at), int)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(at - time[before]) <= np.abs(time[after] - at), before, after)
    exact = np.where(np.abs(at - time[nearest]) <= SAME_S, time[nearest], at)
    gap = time[after] - time[before] > BRIDGED_S
    gap &= np.minimum(np.abs(at - time[before]), np.abs(time[after] - at)) > SAME_S

    def between(values: np.ndarray) -> np.ndarray:
        found = [np.interp(exact, time, column) for column in values.T]
        columns = np.column_stack(found) if found else np.empty((len(at), 0))
        columns[gap] = np.nan
        return columns

    return replace(
        motion, time_s=at, readings=np.where(gap[:, None], np.nan, motion.readings[nearest]),
        degrees=between(motion.degrees), sd_deg=between(motion.sd_deg),
        flags=None if motion.flags is None else motion.flags[nearest],
    )  # fmt: skip


@dataclass(frozen=True)
class ExportFormat:
    """Known by the end of a file's name. What is said of it is for people: docs/exports.md is made of it."""

    suffix: str
    """With its dot, lower case."""
    media_type: str
    write: Callable[[Sequence[HandMotion], Content, Path], None]
    """Writes hands on one time to a file. Raises BadInput."""
    contents: tuple[Content, ...]
    name: str
    unit: str
    axes: str
    times: str
    accuracy: str
    """What it holds of the angles' standard deviations and flags."""
    read_by: str
    needs: tuple[str, str] | None = None
    """Module and package of an extra, where it needs one."""
