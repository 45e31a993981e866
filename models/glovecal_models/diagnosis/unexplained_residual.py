"""Is a residual significant that no known effect explains, and what is it associated with?

Slow errors, errors that joints share, and errors far above the noise floor are no noise. A healthy glove has
them too: it slips a little while it is worn, and its calibration is unsure where training data are few.
Significant is what exceeds a healthy glove's.

Beside effects that remember, what their unknown start leaves is not judged. Nobody recorded what a joint did
before a take, so the state of a memory starts as a guess, and the error of that guess stays until the effect
has settled (``HistoryEffect.unsettled``): an offset of the take that slowly changes. It is the effect's own,
neither noise nor another cause. Until then the mean and the straight line of the error are not judged, and
stretches too short for a line not at all.

On a joint that an effect acts on, what its learned form misses comes on top of what a healthy glove slips by.
Where the whole error is then so few noise floors as a healthy glove's, nothing of it is called unexplained.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from glovecal_models.calibration.held_out import BaseProducts
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.resampled import ResampledTake
from glovecal_models.diagnosis.residual_association import ResidualAssociation, residual_associations
from glovecal_models.diagnosis.slow_error import (
    NOTHING_SHARED,
    FloorRatio,
    SecondMeans,
    SharedError,
    SlowError,
    floor_ratios,
    second_means,
    shared_error,
    slow_error,
    without_drift,
)
from glovecal_models.effects.base.dynamics import unbroken
from glovecal_models.layout import Layout

SHORTEST_LINE_S = 4.0
"""As the shortest take of which a slow error is judged."""
MOST_JOINTS = 6
"""So many of the worst are tested against every column."""
Obstacle = Literal["single poses", "still hand", "no measured angle", "few stretches", "wide interval"]
"""Why takes cannot tell: their frames are single poses, the hand keeps still, their reference only names
poses, too little was measured, or the estimate exceeds a healthy glove's and its lower bound does not."""


@dataclass(frozen=True)
class SlowExcess:
    """The slow error of one joint beside the most that a healthy glove has."""

    joint: str
    error: SlowError
    healthy_deg: float
    is_within_takes: bool = False
    """Whether each take's mean and straight line were taken out."""


NOTHING_STATED: Mapping[str, float] = {}


@dataclass(frozen=True)
class UnexplainedResidual:
    """Whether held-out residuals exceed a healthy glove's, and the evidence."""

    is_significant: bool = False
    obstacle: Obstacle | None = None
    """Why these takes cannot tell; None where they can."""
    slow: Mapping[str, SlowError] = field(default_factory=dict)
    """For each joint."""
    within_takes: Mapping[str, SlowError] = field(default_factory=dict)
    """The same without each take's mean and straight line."""
    excess: SlowExcess | None = None
    """Of the joint that exceeds a healthy glove most; None where none does, or where one may."""
    floor_ratios: Mapping[str, FloorRatio] = field(default_factory=dict)
    """The error of each joint whose floor is known, in floors."""
    above_floor: tuple[str, ...] = ()
    """Joints whose error exceeds its floor by more than a healthy glove's, the farthest first."""
    shared: SharedError = NOTHING_SHARED
    is_shared: bool = False
    """Whether joints share significantly more than in a healthy glove."""
    associations: tuple[ResidualAssociation, ...] = ()
    """Recorded columns that it depends on, the one that explains most first."""
    undecided: tuple[str, ...] = ()
    """Effects that these takes cannot decide and that may explain it."""
    after: tuple[str, ...] = ()
    """Effects of the model, and the one that is named: the residual is what is left after them."""
    unsettled: tuple[str, ...] = ()
    """Those among them whose memory outlasts the takes: offsets of whole takes are not judged."""
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS

    @property
    def is_within_floors(self) -> bool:
        """Whether every error lies in the interval of its noise floor: only then is it noise."""
        every = self.floor_ratios.values()
        return len(every) == len(self.slow) > 0 and all(item.is_within_floor for item in every)

    @property
    def judged(self) -> tuple[SlowError, ...]:
        """Slow errors of the joints that were measured for long enough."""
        return tuple(item for item in self.slow.values() if _is_judgeable(item, self.limits))


def unexplained_residual(
    design: ForwardDesign,
    even: Sequence[ResampledTake],
    layout: Layout,
    seed: int = 0,
    *,
    floors: Mapping[str, NoiseFloor],
    healthy: Set[str] = frozenset(),
    stated_deg: Mapping[str, float] = NOTHING_STATED,
) -> UnexplainedResidual:
    """Judge the held-out residuals of ``design``.

    ``healthy``: joints whose error is known to be a healthy glove's (``healthy_beside``).

    ``stated_deg``: of each joint whose reference states deviations, degrees. What a camera gets wrong lasts:
    a slow error no larger than them is the camera's, and what joints share too, as it sees one hand.

    ``even``: its takes, for their readings; ``floors``: of each joint where it is known.
    """
    # The joint that exceeds most is asked for: the bounds hold for all joints together.
    unsure = (1.0 - design.limits.slow_confidence) / len(design.rotations)
    limits = replace(design.limits, slow_confidence=1.0 - unsure)
    design, generator = replace(design, limits=limits), np.random.default_rng(seed)
    means = [second_means(design, joint) for joint in range(len(design.rotations))]
    slow = _slow(design, means)
    within = _slow(design, [[without_drift(take) for take in takes] for takes in means])
    found = UnexplainedResidual(
        slow=dict(zip(design.rotations, slow, strict=True)),
        within_takes=dict(zip(design.rotations, within, strict=True)),
        floor_ratios=floor_ratios(design, floors),
        limits=limits,
    )
    above = [name for name, item in found.floor_ratios.items() if item.exceeds > 1]
    above.sort(key=lambda name: -found.floor_ratios[name].exceeds)
    found = replace(found, above_floor=tuple(above))
    if not found.judged:
        return replace(found, obstacle="few stretches")
    found = replace(found, shared=shared_error(means, generator, limits))
    ratios = [
        0.0 if name in healthy else _ratio(over_all, inside, limits)
        for name, over_all, inside in zip(design.rotations, slow, within, strict=True)
    ]
    exceeding = sorted((i for i, ratio in enumerate(ratios) if ratio > 1), key=lambda i: -ratios[i])
    exceeding = [i for i in exceeding if slow[i].lower_bound_deg > stated_deg.get(design.rotations[i], 0.0)]
    is_shared = _is_shared(found) and not stated_deg and len(healthy) < len(slow)
    if not exceeding and not is_shared and not above:
        possible = None if stated_deg else _possible_excess(found, healthy)
        return replace(found, excess=possible, obstacle="wide interval") if possible else found
    farthest = [design.rotations.index(name) for name in above]
    chosen = (list(dict.fromkeys([*exceeding, *farthest])) or list(range(len(slow))))[:MOST_JOINTS]
    return replace(
        found,
        is_significant=True,
        excess=_excess(found, design.rotations[exceeding[0]]) if exceeding else None,
        is_shared=is_shared,
        associations=residual_associations(design, even, layout, chosen, means, generator),
    )


def within_slip(design: ForwardDesign) -> tuple[int, ...]:
    """Joints of ``design`` whose slow error is no larger than a healthy glove's."""
    means = [second_means(design, joint) for joint in range(len(design.rotations))]
    slow = enumerate(_slow(design, means))
    return tuple(joint for joint, item in slow if item.size_deg <= _healthy(item, design.limits))


def _slow(design: ForwardDesign, means: Sequence[Sequence[SecondMeans]]) -> list[SlowError]:
    return [
        slow_error(takes, products.residual, design.limits)
        for takes, products in zip(means, design.products, strict=True)
    ]


def _is_judgeable(item: SlowError, limits: DiagnosisLimits) -> bool:
    return item.stretches >= limits.slow_fewest_stretches


def _is_shared(found: UnexplainedResidual) -> bool:
    limits = found.limits
    noise = float(np.median([item.noise_deg for item in found.judged]))
    healthy = max(limits.healthy_shared_deg, limits.healthy_within_noises * noise)
    return found.shared.p_value <= limits.shared_p_value and found.shared.size_deg > healthy


def _ratio(item: SlowError, within: SlowError, limits: DiagnosisLimits) -> float:
    """How many times more than in a healthy glove, at the lower bound; 0 where it cannot be judged."""
    if not _is_judgeable(item, limits):
        return 0.0
    overall = item.lower_bound_deg / _healthy(item, limits)
    return max(overall, within.lower_bound_deg / _healthy_within(within, limits))


def _excess(found: UnexplainedResidual, joint: str) -> SlowExcess:
    """The error as it is where that exceeds a healthy glove's, else within takes."""
    item, within, limits = found.slow[joint], found.within_takes[joint], found.limits
    if item.lower_bound_deg > _healthy(item, limits):
        return SlowExcess(joint, item, _healthy(item, limits))
    return SlowExcess(joint, within, _healthy_within(within, limits), is_within_takes=True)


def _possible_excess(found: UnexplainedResidual, healthy: Set[str]) -> SlowExcess | None:
    """The largest error, where it may exceed a healthy glove's and there is too little of it to tell;
    ``healthy``: joints whose error is a healthy glove's."""
    limits = found.limits
    judged = [
        (joint, item)
        for joint, item in found.slow.items()
        if _is_judgeable(item, limits) and joint not in healthy
    ]
    if not judged:
        return None
    joint, worst = max(judged, key=lambda pair: pair[1].size_deg)
    most = _healthy(worst, limits)
    if worst.size_deg <= most or worst.stretches >= limits.enough_stretches:
        return None
    return SlowExcess(joint, worst, most)


def healthy_beside(
    design: ForwardDesign, known: Sequence[KnownEffect], floors: Mapping[str, NoiseFloor]
) -> frozenset[str]:
    """Joints that an effect acts on and whose error is so few floors as a healthy glove's."""
    there = {name for item in known for name in item.joints}
    ratios = floor_ratios(design, floors)
    return frozenset(name for name, item in ratios.items() if name in there and item.is_healthy)


def _healthy(item: SlowError, limits: DiagnosisLimits) -> float:
    return max(limits.healthy_deg, limits.healthy_noises * item.noise_deg)


def _healthy_within(item: SlowError, limits: DiagnosisLimits) -> float:
    return max(limits.healthy_within_deg, limits.healthy_within_noises * item.noise_deg)


def without_unsettled(design: ForwardDesign, known: Sequence[KnownEffect]) -> ForwardDesign:
    """The design with those rows and residuals that can be judged; the same where nothing remembers."""
    masks = [_unsettled(design, known, joint) for joint in range(len(design.rotations))]
    if not any(masks):
        return design
    judged = [_judged(design, joint, mask) for joint, mask in enumerate(masks)]
    used, products = zip(*judged, strict=True)
    return replace(design, used=used, products=products, kept={})


def unsettled_effects(design: ForwardDesign, known: Sequence[KnownEffect]) -> tuple[str, ...]:
    """Names of those that settle in none of the takes: nothing is known of offsets of whole takes."""
    found = [
        item.effect.name
        for item in known
        for joint in range(len(design.rotations))
        if (masks := _unsettled(design, [item], joint)) and all(mask.all() for mask in masks)
    ]
    return tuple(dict.fromkeys(found))


def _unsettled(design: ForwardDesign, known: Sequence[KnownEffect], joint: int) -> list[np.ndarray]:
    """For each take (N,) where an effect on a joint has not settled; empty where none remembers."""
    name = design.rotations[joint]
    every = [item.unsettled(design.signals, joint, name) for item in known]
    return [np.any(masks, axis=0) for masks in zip(*(each for each in every if each), strict=True)]


def _judged(
    design: ForwardDesign, joint: int, masks: Sequence[np.ndarray]
) -> tuple[tuple[np.ndarray, ...], BaseProducts]:
    """The rows of each unit and what the base leaves there, of one joint; ``masks`` of its takes, or none."""
    products = copy.copy(design.products[joint])
    if not masks:
        return design.used[joint], products
    used, units, residuals = [], [], []
    parts = zip(design.units(joint), products.units, products.residual, strict=True)
    for (take, rows), unit, residual in parts:
        left = _settled_part(design.signals[take].time_s, rows, residual, masks[take])
        kept = np.isfinite(left)
        used.append(rows[kept])
        weight = None if unit.weight is None else unit.weight[kept]
        units.append(replace(unit, base=unit.base[kept], target=unit.target[kept], weight=weight))
        residuals.append(left[kept])
    products.units, products.residual = units, tuple(residuals)
    return tuple(used), products


def _settled_part(time_s: np.ndarray, rows: np.ndarray, residual: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """(M,) at the ``rows`` of a take of ``time_s`` (N,), NaN where nothing can be judged; ``mask`` (N,) is
    True where effects have not settled, which they begin anew after a gap."""
    result = residual.copy()
    for part in unbroken(time_s):
        early = (rows >= part.start) & (rows < part.stop) & mask[rows]
        at = time_s[rows[early]]
        if not len(at):
            continue
        if np.ptp(at) < SHORTEST_LINE_S:
            result[early] = np.nan
        else:
            result[early] -= np.polyval(np.polyfit(at - at[0], result[early], 1), at - at[0])
    return result
