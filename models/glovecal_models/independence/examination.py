"""One rotation examined: what its sensor did while it was kept still and others moved.

The source is Wang & Neff 2013, section 3.1: standard and largest deviation in per cent of the active range.
What a joint did that moved all the same is taken out where its angle was measured. Where it was not, a joint
that moves along with a neighbour looks like that neighbour's crosstalk.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.independence.active_range import ActiveRange
from glovecal_models.independence.coupling import (
    AffectingShare,
    Coupling,
    decompose,
    follows_the_rule,
)
from glovecal_models.independence.smooth_readings import SmoothTake
from glovecal_models.independence.still_frames import (
    LEAST_MOVED,
    NO_CROSSTALK,
    KnownCrosstalk,
    StillFrames,
    alone,
    constants,
    deviations,
    still_frames,
)
from glovecal_models.independence.still_rotation import Stillness, stillness

LEAST_BLOCKS = 10
SURELY_MOVED = 0.3
"""Of its range: errors of the known crosstalk are always smaller."""
UNEXPLAINED_PCT = 5.0
"""Of the range: so much that no other sensor explains is a joint that was not still."""


@dataclass(frozen=True)
class NotExamined:
    """A rotation that was kept still in a take, but could not be examined."""

    rotation: str
    unknown_range: ActiveRange | None
    """Of its sensor; None: the takes are too short."""
    seconds: int
    """For which it was kept still."""


@dataclass(frozen=True)
class RotationExamination:
    """Per cent of the own sensor's active range."""

    rotation: str
    sensor: str
    takes: tuple[str, ...]
    seconds: float
    std_pct: float
    max_pct: float
    is_coupled: bool
    """By the paper's rule, from 5 % standard or 12 % largest deviation on."""
    coupling: Coupling
    stillness: Stillness | None
    """By measured angles; None where there are none."""
    active_range: ActiveRange
    not_moved: tuple[str, ...]
    """Sensors that moved too little, or only by crosstalk of others: whether they affect this one is not
    known."""
    is_dead: bool
    """The sensor does not move at all in any take."""
    rough_causes: tuple[str, ...]
    """Causes that are cross-coupled themselves and whose angle was not measured: their shares are rough."""


def examine_rotation(
    rotation: str,
    sensor: str,
    takes: Sequence[SmoothTake],
    ranges: Mapping[str, ActiveRange],
    *,
    dead: bool = False,
    known: KnownCrosstalk = NO_CROSSTALK,
) -> RotationExamination | NotExamined:
    """From one or more takes in which ``rotation`` was kept still, at the same angle or at others.

    A sensor that is cross-coupled itself can look like a cause, so ``known`` crosstalk is subtracted.
    NotExamined when the range is unknown, or the takes are too short.
    """
    scale = ranges[sensor].readings
    if not scale:
        return NotExamined(rotation, ranges[sensor], 0)
    frames = still_frames(takes, rotation, sensor, ranges, known)
    blocks = sum(len(np.unique(item.block)) for item in frames)
    if blocks < LEAST_BLOCKS:
        return NotExamined(rotation, None, blocks)
    causes = alone(frames) or frames
    moved = {name: np.concatenate([item.moved[name] for item in causes]) for name in frames[0].moved}
    at_once = causes is frames
    coupling = _decomposed(causes, scale, moved, known, at_once)
    std, largest = deviations(frames, 100 / scale, coupling.constants[len(causes) :])
    unmeasured = {name for name in known.coupled if any(item.angle(name) is None for item in takes)}
    rough = unmeasured if at_once and len(coupling.shares) > 1 else set()
    coupling = replace(coupling, shares=tuple(_uncertain(share, rough) for share in coupling.shares))
    still = _least_still(takes, rotation)
    unknown = {name for name in unmeasured - set(coupling.curves) if not _surely_moves(name, moved, known)}
    return RotationExamination(
        rotation=rotation,
        sensor=sensor,
        takes=tuple(item.take.name for item in takes),
        seconds=float(sum(item.time_s[-1] - item.time_s[0] for item in takes)),
        std_pct=std,
        max_pct=largest,
        is_coupled=follows_the_rule(std, largest),
        coupling=coupling,
        stillness=still,
        active_range=ranges[sensor],
        not_moved=tuple(name for name in moved if not _moves(moved[name]) or name in unknown),
        is_dead=dead,
        rough_causes=tuple(name for name in coupling.curves if name in rough),
    )


def _decomposed(
    causes: Sequence[StillFrames],
    scale: float,
    moved: Mapping[str, np.ndarray],
    known: KnownCrosstalk,
    at_once: bool,
) -> Coupling:
    target = np.concatenate([item.target for item in causes]) * 100 / scale
    block = np.concatenate([item.block + 1e6 * number for number, item in enumerate(causes)])
    moving = {name: share for name, share in moved.items() if _moves(share)}
    return decompose(target, moving, constants(causes), block, known.coupled, at_once=at_once)


def _moves(share: np.ndarray) -> bool:
    return bool(np.ptp(share) >= LEAST_MOVED)


def _surely_moves(name: str, moved: Mapping[str, np.ndarray], known: KnownCrosstalk) -> bool:
    """Whether a cross-coupled sensor moved by more than what is left when the crosstalk is subtracted."""
    return name in known.crosstalk and name in moved and bool(np.ptp(moved[name]) >= SURELY_MOVED)


def _uncertain(share: AffectingShare, rough: Set[str]) -> AffectingShare:
    """A cause seen by a cross-coupled sensor is no sure one."""
    return replace(share, affects=None) if share.sensor in rough and share.affects else share


def _least_still(takes: Sequence[SmoothTake], rotation: str) -> Stillness | None:
    found = [how for item in takes if (how := stillness(item, rotation)) is not None]
    return max(found, key=lambda how: how.std_pct, default=None)
