"""Negative controls: the effect's columns with the same freedom, made of inputs that cannot be right.

What a control saves on held-out takes, flexibility alone saves; only what an effect saves beyond it counts.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.effects.base.effect import CorrectionEffect
from glovecal_models.effects.base.signals import Settings, Signals
from glovecal_models.errors import BadInput

SHIFT_SHARE = (0.2, 0.8)
"""Of a take's length."""
MOST_PERMUTATIONS = 200


def control_columns(
    effect: CorrectionEffect,
    takes: Sequence[Signals],
    settings: Settings,
    shape: np.ndarray,
    generator: np.random.Generator,
    rows: Sequence[np.ndarray | slice] | None = None,
) -> list[np.ndarray]:
    """Columns (N, L, C) of the effect's control for each take, for the same settings and shape (L, P).

    ``rows``: at these of each take only, for effects that do not remember and are not played backwards.
    Raises BadInput when the takes allow no control: wearings with no other permutation.
    """
    wrong = control_signals(effect, takes, generator)
    if rows is not None:
        wrong = [take.at(some) for take, some in zip(wrong, rows, strict=True)]
    if effect.comparison.control == "none":
        return [np.zeros_like(part) for part in effect.dynamics.columns_of_takes(wrong, settings, shape)]
    step = -1 if effect.comparison.control == "time-reversed" else 1
    return [part[::step] for part in effect.dynamics.columns_of_takes(wrong, settings, shape)]


def control_signals(
    effect: CorrectionEffect, takes: Sequence[Signals], generator: np.random.Generator
) -> list[Signals]:
    """Inputs of the effect that cannot be right: takes played backwards (their rows are then in reverse),
    shifted in time, or with the context or the wearing of other takes. Raises BadInput as above."""
    if effect.comparison.control == "time-reversed":
        return [_reversed(take) for take in takes]
    if effect.comparison.control == "circularly shifted":
        return [_shifted(take, generator) for take in takes]
    if effect.comparison.control == "context of other takes":
        return _with_other_context(takes, generator)
    if effect.comparison.control == "permuted wearings":
        return _with_permuted_wearings(takes, generator)
    return list(takes)


def _reversed(take: Signals) -> Signals:
    return replace(
        take,
        time_s=take.time_s[0] + take.time_s[-1] - take.time_s[::-1],
        own=take.own[::-1],
        others={name: values[::-1] for name, values in take.others.items()},
        context={name: values[::-1] for name, values in take.context.items()},
    )


def _shifted(take: Signals, generator: np.random.Generator) -> Signals:
    """Own, others and context shifted together, so that no column stays where it was right."""
    shift = round(generator.uniform(*SHIFT_SHARE) * len(take))
    return replace(
        take,
        own=_rolled(take.own, shift),
        others={name: _rolled(values, shift) for name, values in take.others.items()},
        context={name: _rolled(values, shift) for name, values in take.context.items()},
    )


def _rolled(values: np.ndarray, shift: int) -> np.ndarray:
    """As ``np.roll`` along the first axis, which takes several times as long for short columns."""
    at = len(values) - shift % max(len(values), 1)
    return np.concatenate([values[at:], values[:at]])


def _with_other_context(takes: Sequence[Signals], generator: np.random.Generator) -> list[Signals]:
    """Each take with the context of another one, of another wearing where possible.

    A single take has no other: its context is circularly shifted.
    """
    if len(takes) < 2:
        return [replace(take, context=_shifted(take, generator).context) for take in takes]
    from scipy.optimize import linear_sum_assignment  # slow to load, and every effect imports this file

    cost = generator.uniform(0.0, 1e-3, (len(takes), len(takes)))
    for row, take in enumerate(takes):
        cost[row] += [1.0 if take.wearing == other.wearing else 0.0 for other in takes]
        cost[row, row] += 1e6
    _, giver = linear_sum_assignment(cost)
    return [with_context(take, takes[other]) for take, other in zip(takes, giver, strict=True)]


def with_context(take: Signals, giver: Signals) -> Signals:
    """The take with another one's context columns, resampled to its frames."""
    return replace(take, context=_stretched(giver.context, len(take)))


def _stretched(context: Mapping[str, np.ndarray], length: int) -> dict[str, np.ndarray]:
    """Context columns resampled to so many frames."""
    result = {}
    for name, values in context.items():
        place = np.linspace(0.0, len(values) - 1.0, length)
        result[name] = np.interp(place, np.arange(len(values)), values)
    return result


def _with_permuted_wearings(takes: Sequence[Signals], generator: np.random.Generator) -> list[Signals]:
    """Wearings permuted among takes, within the same motion where names tell; never the true partition."""
    true = _partition([take.wearing for take in takes])
    for motions in (motions_of(takes), [""] * len(takes)):
        for _ in range(MOST_PERMUTATIONS):
            permuted = _permuted_names([take.wearing for take in takes], motions, generator)
            if _partition(permuted) != true:
                return [replace(take, wearing=wearing) for take, wearing in zip(takes, permuted, strict=True)]
    raise BadInput("the wearings of these takes have no other permutation; record two takes in a wearing")


def _permuted_names(wearings: list[str], motions: list[str], generator: np.random.Generator) -> list[str]:
    permuted = wearings.copy()
    for motion in dict.fromkeys(motions):
        members = [index for index, other in enumerate(motions) if other == motion]
        for index, source in zip(members, map(int, generator.permutation(members)), strict=True):
            permuted[index] = wearings[source]
    return permuted


def _partition(wearings: Sequence[str]) -> frozenset[frozenset[int]]:
    """Which takes are together; names of wearings do not matter."""
    return frozenset(
        frozenset(index for index, other in enumerate(wearings) if other == wearing) for wearing in wearings
    )


def motions_of(takes: Sequence[Signals]) -> list[str]:
    """What each take's name says of its motion; see ``motion_words``."""
    return [motion_words(take.take, take.wearing) for take in takes]


def motion_words(take: str, wearing: str) -> str:
    """The words of a take's name that are neither numbered nor part of its wearing's name."""
    known = set(re.split(r"[^A-Za-z0-9]+", wearing.lower()))
    words = [word for word in re.split(r"[^A-Za-z0-9]+", take.lower()) if word not in known]
    return " ".join(word for word in words if not re.search(r"\d", word))
