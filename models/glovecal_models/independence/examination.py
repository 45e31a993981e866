"""One rotation examined: what its sensor did while it was kept still and others moved.

The source is Wang & Neff 2013, section 3.1: standard and largest deviation in per cent of the active range.
What a joint did that moved all the same is taken out where its angle was measured. Where it was not, a joint
that moves along with a neighbour looks like that neighbour's pull.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.independence.active_range import ActiveRange
from glovecal_models.independence.affecting_shares import (
    AffectingShare,
    TakenApart,
    follows_the_rule,
    take_apart,
)
from glovecal_models.independence.smooth_readings import SmoothTake
from glovecal_models.independence.still_frames import (
    LEAST_MOVED,
    NOTHING_KNOWN,
    KnownPulls,
    StillFrames,
    alone,
    constants,
    deviations,
    still_frames,
)
from glovecal_models.independence.still_rotation import Stillness, stillness

LEAST_BLOCKS = 10
SURELY_MOVED = 0.3
"""Of its range: so far known pulls never are off."""
UNEXPLAINED_PCT = 5.0
"""Of the range: so much that no other sensor explains is a joint that was not still."""


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
    taken_apart: TakenApart
    stillness: Stillness | None
    """By measured angles; None where there are none."""
    active_range: ActiveRange
    not_moved: tuple[str, ...]
    """Sensors that moved too little, or only because others pull on them: whether they affect this one is not
    known."""
    is_dead: bool
    """The sensor does not move at all in any take."""
    doubts: tuple[str, ...]


def examine_rotation(
    rotation: str,
    sensor: str,
    takes: Sequence[SmoothTake],
    ranges: Mapping[str, ActiveRange],
    *,
    dead: bool = False,
    known: KnownPulls = NOTHING_KNOWN,
) -> RotationExamination | str:
    """From one or more takes in which ``rotation`` was kept still, at the same angle or at others.

    A sensor that is pulled itself can look like a cause, so ``known`` pulls are taken off. A sentence
    instead when nothing can be told in per cent, or the takes are too short.
    """
    scale = ranges[sensor].readings
    if not scale:
        return ranges[sensor].sentence or f"The range of {sensor} was not seen yet."
    frames = still_frames(takes, rotation, sensor, ranges, known)
    blocks = sum(len(np.unique(item.block)) for item in frames)
    if blocks < LEAST_BLOCKS:
        return (
            f"{rotation} was kept still for {blocks} s in all; move the others for {LEAST_BLOCKS} s or more."
        )
    causes = alone(frames) or frames
    moved = {name: np.concatenate([item.moved[name] for item in causes]) for name in frames[0].moved}
    at_once = causes is frames
    apart = _apart(causes, scale, moved, known, at_once)
    std, largest = deviations(frames, 100 / scale, apart.constants[len(causes) :])
    unmeasured = {name for name in known.pulled if any(item.angle(name) is None for item in takes)}
    rough = unmeasured if at_once and len(apart.shares) > 1 else set()
    apart = replace(apart, shares=tuple(_in_doubt(share, rough) for share in apart.shares))
    still = _least_still(takes, rotation)
    unknown = {name for name in unmeasured - set(apart.curves) if not _surely_moves(name, moved, known)}
    return RotationExamination(
        rotation=rotation,
        sensor=sensor,
        takes=tuple(item.take.name for item in takes),
        seconds=float(sum(item.time_s[-1] - item.time_s[0] for item in takes)),
        std_pct=std,
        max_pct=largest,
        is_coupled=follows_the_rule(std, largest),
        taken_apart=apart,
        stillness=still,
        active_range=ranges[sensor],
        not_moved=tuple(name for name in moved if not _moves(moved[name]) or name in unknown),
        is_dead=dead,
        doubts=(
            *_doubts(rotation, sensor, still, apart, ranges[sensor], dead),
            *_rough_sentence(sensor, [name for name in apart.curves if name in rough]),
        ),
    )


def _apart(
    causes: Sequence[StillFrames],
    scale: float,
    moved: Mapping[str, np.ndarray],
    known: KnownPulls,
    at_once: bool,
) -> TakenApart:
    target = np.concatenate([item.target for item in causes]) * 100 / scale
    block = np.concatenate([item.block + 1e6 * number for number, item in enumerate(causes)])
    moving = {name: share for name, share in moved.items() if _moves(share)}
    return take_apart(target, moving, constants(causes), block, known.pulled, at_once=at_once)


def _moves(share: np.ndarray) -> bool:
    return bool(np.ptp(share) >= LEAST_MOVED)


def _surely_moves(name: str, moved: Mapping[str, np.ndarray], known: KnownPulls) -> bool:
    """Whether a sensor that others pull on moved by more than what is left when their pulls are taken off."""
    return name in known.pulls and name in moved and bool(np.ptp(moved[name]) >= SURELY_MOVED)


def _in_doubt(share: AffectingShare, rough: Set[str]) -> AffectingShare:
    """A cause told by a sensor that others pull on is no sure one."""
    return replace(share, affects=None) if share.sensor in rough and share.affects else share


def _rough_sentence(sensor: str, rough: Sequence[str]) -> list[str]:
    if not rough:
        return []
    return [
        f"Others pull on {' and '.join(rough)} too, so the shares in what {sensor} does are rough: measure "
        f"the angles, or move each joint alone, in takes called like still-{sensor}-move-{rough[0]}."
    ]


def _least_still(takes: Sequence[SmoothTake], rotation: str) -> Stillness | None:
    found = [how for item in takes if (how := stillness(item, rotation)) is not None]
    return max(found, key=lambda how: how.std_pct, default=None)


def _doubts(
    rotation: str,
    sensor: str,
    still: Stillness | None,
    apart: TakenApart,
    known: ActiveRange,
    dead: bool,
) -> list[str]:
    doubts = []
    if dead:
        doubts.append(f"Sensor {sensor} does not move in any take: is it broken, or its wire?")
    if still is not None and not still.is_still:
        doubts.append(
            f"{rotation} was not still: it moved by {still.std_pct:.0f} % of its range (standard deviation; "
            f"{still.span_pct:.0f} % from end to end). What its measured angle explains is taken out."
        )
    if still is None and apart.unexplained_pct >= UNEXPLAINED_PCT:
        doubts.append(
            f"{sensor} moved by {apart.unexplained_pct:.0f} % of its range in a way that goes with no other "
            f"sensor: was {rotation} really kept still? Nothing else here measures it."
        )
    for share in apart.shares:
        if share.rivals and share.affects is not False:
            doubts.append(
                f"{share.sensor} and {' and '.join(share.rivals)} always moved together, so which of them "
                f"pulls on {sensor} cannot be told: move each for some seconds by itself."
            )
    return [*doubts, *([known.sentence] if known.sentence else [])]
