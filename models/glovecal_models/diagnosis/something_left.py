"""Is something left that no known effect explains, and what does it go with?

Errors that last, or that joints share, are no noise. A healthy glove has them too: it slips a little while it
is worn, and its calibration is unsure where it has seen little. Only what surely exceeds both is told.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.goes_with import GoesWith, goes_with
from glovecal_models.diagnosis.limits import DiagnosisLimits
from glovecal_models.diagnosis.resampled import ResampledTake
from glovecal_models.diagnosis.shared_error import NOTHING_SHARED, SharedError, shared_error
from glovecal_models.diagnosis.slow_error import (
    SecondMeans,
    SlowError,
    second_means,
    slow_error,
    without_drift,
)
from glovecal_models.layout import Layout

MOST_JOINTS = 6
"""So many of the worst are held against every column."""
MOST_SAID = 3


@dataclass(frozen=True)
class Left:
    """The answer, and what it rests on."""

    is_left: bool
    sentence: str
    lasting: Mapping[str, SlowError] = field(default_factory=dict)
    """For each joint."""
    within_takes: Mapping[str, SlowError] = field(default_factory=dict)
    """The same without each take's mean and straight line."""
    shared: SharedError = NOTHING_SHARED
    goes_with: tuple[GoesWith, ...] = ()
    """Recorded columns that it depends on, the one that explains most first."""
    not_judgeable: str | None = None
    """Why these takes cannot tell."""


def not_told(why: str) -> Left:
    return Left(False, f"Whether something is left that lasts cannot be judged: {why}.", not_judgeable=why)


def something_left(
    design: ForwardDesign,
    even: Sequence[ResampledTake],
    layout: Layout,
    seed: int = 0,
    *,
    may_be: Sequence[str] = (),
) -> Left:
    """Judge the held-out residuals of ``design``, known effects included in its base.

    ``even``: its takes, for their readings. ``may_be``: effects that save much and that these takes cannot
    decide; they are not in the base.
    """
    generator, limits = np.random.default_rng(seed), design.limits
    means = [second_means(design, joint) for joint in range(len(design.rotations))]
    found = _lasting(design, means)
    wandering = _lasting(design, [[without_drift(take) for take in takes] for takes in means])
    judged = [item for item in found if item.stretches >= limits.slow_fewest_stretches]
    if not judged:
        return not_told(_too_little(found, limits))
    left = Left(
        False,
        "",
        dict(zip(design.rotations, found, strict=True)),
        dict(zip(design.rotations, wandering, strict=True)),
        shared_error(means, generator, limits),
    )
    excess = [_excess(*items, limits) for items in zip(found, wandering, strict=True)]
    lasts = sorted((i for i, item in enumerate(excess) if item > 1), key=lambda i: -excess[i])
    is_shared = _is_shared(left.shared, judged, limits)
    if not lasts and not is_shared:
        unsure = _unsure(judged, limits)
        sentence = f"Something may be left: {unsure}." if unsure else _noise_sentence(judged)
        return replace(left, sentence=sentence, not_judgeable=unsure)
    chosen = (lasts or list(range(len(found))))[:MOST_JOINTS]
    columns = goes_with(design, even, layout, chosen, means, generator)
    worst = design.rotations[lasts[0]] if lasts else None
    sentence = _sentence(left, worst, is_shared, columns, may_be, limits)
    return replace(left, is_left=True, goes_with=columns, sentence=sentence)


def _lasting(design: ForwardDesign, means: Sequence[Sequence[SecondMeans]]) -> list[SlowError]:
    return [
        slow_error(takes, products.residual, design.limits)
        for takes, products in zip(means, design.products, strict=True)
    ]


def _too_little(found: Sequence[SlowError], limits: DiagnosisLimits) -> str:
    most = max((item.stretches for item in found), default=0)
    needed = limits.slow_fewest_stretches
    return f"{most} stretches of {limits.slow_shortest_s} s or more were measured, {needed} are needed"


def _is_shared(shared: SharedError, judged: Sequence[SlowError], limits: DiagnosisLimits) -> bool:
    noise = float(np.median([item.noise_deg for item in judged]))
    allowed = max(limits.healthy_shared_deg, limits.healthy_within_noises * noise)
    return shared.probability <= limits.shared_p_value and shared.size_deg > allowed


def _sentence(
    left: Left,
    worst: str | None,
    is_shared: bool,
    columns: Sequence[GoesWith],
    may_be: Sequence[str],
    limits: DiagnosisLimits,
) -> str:
    why = []
    if worst is not None:
        why.append(_lasts_sentence(worst, left.lasting[worst], left.within_takes[worst], limits))
    if is_shared:
        why.append(
            f"the errors of several joints rise and fall together by {left.shared.size_deg:.1f} degrees"
        )
    known = "known effect" if not may_be else "effect these takes can decide"
    sentence = f"Something is left that no {known} explains: {' and '.join(why)}; {_told(columns)}."
    return f"{sentence} It may be {' or '.join(may_be)}." if may_be else sentence


def _excess(item: SlowError, within: SlowError, limits: DiagnosisLimits) -> float:
    """How many times more lasts than in a healthy glove, at the lower bound; 0 where it cannot be judged."""
    if item.stretches < limits.slow_fewest_stretches:
        return 0.0
    return max(
        item.at_least_deg / _allowed(item, limits), within.at_least_deg / _allowed_within(within, limits)
    )


def _allowed(item: SlowError, limits: DiagnosisLimits) -> float:
    return max(limits.healthy_deg, limits.healthy_noises * item.noise_deg)


def _allowed_within(item: SlowError, limits: DiagnosisLimits) -> float:
    return max(limits.healthy_within_deg, limits.healthy_within_noises * item.noise_deg)


def _lasts_sentence(joint: str, item: SlowError, within: SlowError, limits: DiagnosisLimits) -> str:
    if item.at_least_deg > _allowed(item, limits):
        said, allowed, where = item, _allowed(item, limits), "for seconds"
    else:
        said, allowed, where = within, _allowed_within(within, limits), "for seconds, within takes"
    return (
        f"an error of {joint} lasts {where} ({said.size_deg:.2f} degrees, surely more than"
        f" {said.at_least_deg:.2f}; of a healthy glove at most {allowed:.2f})"
    )


def _noise_sentence(judged: Sequence[SlowError]) -> str:
    worst = max(item.size_deg for item in judged)
    return f"What is left looks like noise: errors that last for seconds come to {worst:.1f} degrees."


def _unsure(judged: Sequence[SlowError], limits: DiagnosisLimits) -> str | None:
    """Why a large error may yet be a healthy glove's; None when it is small or there is enough of it."""
    worst = max(judged, key=lambda item: item.size_deg)
    allowed = _allowed(worst, limits)
    if worst.size_deg <= allowed or worst.stretches >= limits.enough_stretches:
        return None
    return (
        f"errors that last for seconds come to {worst.size_deg:.1f} degrees, but {worst.stretches} stretches"
        f" of time cannot tell them surely from the {allowed:.1f} of a healthy glove; record longer"
        " takes"
    )


def _told(columns: Sequence[GoesWith]) -> str:
    if not columns:
        return "it goes with none of the recorded columns"
    return f"it goes with {', '.join(item.told() for item in columns[:MOST_SAID])}"
