"""Takes recorded from a simulated hand in a simulated glove, with the truth beside them.

The hand goes through segment after segment, with a short movement from each into the next.
"""

from __future__ import annotations

import bisect
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.simulation.hand_motion import minimum_jerk
from glovecal_models.simulation.protocol import Segment
from glovecal_models.simulation.simulated_glove import SimulatedGlove
from glovecal_models.simulation.simulated_hand import DRIVEN, ROTATIONS, SimulatedHand
from glovecal_models.takes.take import Take

BRIDGE_S = 0.4
"""How long the hand takes from the end of one segment to the start of the next."""


@dataclass(frozen=True)
class _Piece:
    """A segment at its place in time, and the movement before it from the posture ``before``."""

    segment: Segment
    begins_s: float
    starts_s: float
    ends_s: float
    before: np.ndarray | None

    def driven(self, time_s: np.ndarray) -> np.ndarray:
        inside = np.clip(time_s - self.starts_s, 0.0, self.segment.duration_s)
        driven = self.segment.driven(inside)
        if self.before is None:
            return driven
        share = (time_s - self.begins_s) / (self.starts_s - self.begins_s)
        return self.before + minimum_jerk(share)[:, None] * (driven - self.before)

    def poses(self, time_s: np.ndarray) -> list[str]:
        names = self.segment.poses(time_s - self.starts_s)
        return [name if at >= self.starts_s else "" for name, at in zip(names, time_s, strict=True)]


class Performance:
    """A hand's rotations and poses as functions of time from 0; after the last segment it stays still.

    ``segments`` may be endless; it is read as far as the times that are asked for.
    """

    def __init__(self, hand: SimulatedHand, segments: Iterable[Segment], rotations: Sequence[str]) -> None:
        self._hand = hand
        self._waiting = iter(segments)
        self._order = [ROTATIONS.index(rotation) for rotation in rotations]
        self._pieces: list[_Piece] = []
        self._starts: list[float] = []
        self._complete = False

    def at(self, time_s: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
        """Angles, shape (N, len(rotations)), degrees, and pose names at increasing times (N,)."""
        self._extend(float(time_s[-1]))
        index = np.searchsorted(self._starts, time_s, side="right") - 1
        driven = np.empty((len(time_s), len(DRIVEN)))
        poses: list[str] = []
        for piece in range(int(index[0]), int(index[-1]) + 1):
            rows = index == piece
            driven[rows] = self._pieces[piece].driven(time_s[rows])
            poses.extend(self._pieces[piece].poses(time_s[rows]))
        angles = self._hand.complete(dict(zip(DRIVEN, driven.T, strict=True)))
        return angles[:, self._order], tuple(poses)

    def segment_at(self, time_s: float) -> str:
        """The name of the segment performed at a time."""
        self._extend(time_s)
        return self._pieces[bisect.bisect_right(self._starts, time_s) - 1].segment.name

    def _extend(self, until_s: float) -> None:
        while not self._complete and (not self._pieces or self._pieces[-1].ends_s <= until_s):
            segment = next(self._waiting, None)
            if segment is None:
                self._complete = True
            else:
                self._append(segment)

    def _append(self, segment: Segment) -> None:
        if self._pieces:
            last = self._pieces[-1]
            begins, starts = last.ends_s, last.ends_s + BRIDGE_S
            before = last.segment.driven(np.array([last.segment.duration_s]))[0]
        else:
            begins, starts, before = 0.0, 0.0, None
        self._pieces.append(_Piece(segment, begins, starts, starts + segment.duration_s, before))
        self._starts.append(begins)


def duration_s(segments: Sequence[Segment]) -> float:
    """How long a performance of all segments takes, in seconds."""
    return sum(segment.duration_s for segment in segments) + BRIDGE_S * max(len(segments) - 1, 0)


REFERENCE_NOISE_DEG = 0.7
NOT_MEASURED = ("PALM_ARCH",)
"""No reference system measures the palm's arch, so simulated takes have no reference for it."""


@dataclass(frozen=True)
class SimulatedTake:
    """A take as a recorder would keep it, and what the hand really did."""

    take: Take
    truth: np.ndarray
    """Shape (N, R), degrees, in the order of the layout's rotations, without measurement noise."""


def simulate_take(
    glove: SimulatedGlove,
    motion: Segment | Sequence[Segment],
    *,
    seed: int = 0,
    rate_hz: float = 120.0,
    reference_noise_deg: float = REFERENCE_NOISE_DEG,
    name: str | None = None,
) -> SimulatedTake:
    """Record one segment, or several moving from each into the next, marked as simulated.

    The reference is measured at the frames' times with independent noise. The same arguments give the
    same take, whatever else was recorded from ``glove``. Raises BadInput when there is nothing to record.
    """
    segments = [motion] if isinstance(motion, Segment) else list(motion)
    if not segments or not rate_hz > 0:
        raise BadInput(f"nothing to record: {len(segments)} segments at {rate_hz:g} Hz")
    time = np.arange(max(round(duration_s(segments) * rate_hz), 1)) / rate_hz
    truth, poses = Performance(glove.hand, segments, glove.rotations).at(time)
    random = np.random.default_rng([seed, 30, glove.wearing])
    readings = glove.readings(truth, random)
    measured = measured_rotations(glove)
    columns = [glove.rotations.index(rotation) for rotation in measured]
    take = Take(
        name=name or "-".join(dict.fromkeys(segment.name for segment in segments)),
        wearing=f"wearing-{glove.wearing}",
        sensors=glove.sensors,
        time_s=time,
        readings=readings,
        rotations=measured,
        reference_time_s=time,
        reference=truth[:, columns]
        + reference_noise_deg * random.standard_normal((len(truth), len(columns))),
        poses=poses if any(poses) else None,
        simulated=True,
    )
    return SimulatedTake(take, truth)


def measured_rotations(glove: SimulatedGlove) -> tuple[str, ...]:
    """Rotations a simulated take has a reference for."""
    return tuple(rotation for rotation in glove.rotations if rotation not in NOT_MEASURED)
