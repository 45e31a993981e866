"""The decoy twin of an effect: columns with the same freedom that cannot be right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.effects.effect import Effect, Settings, Signals


def decoy_columns(
    effect: Effect,
    takes: Sequence[Signals],
    settings: Settings,
    shape: np.ndarray,
    generator: np.random.Generator,
) -> list[np.ndarray]:
    """For each take (N, L, C)."""
    if effect.decoy == "reversed in time":
        return [effect.columns(_reversed(take), settings, shape)[::-1] for take in takes]
    if effect.decoy == "rolled in time":
        return [effect.columns(_rolled(take, generator), settings, shape) for take in takes]
    if effect.decoy == "context of other takes":
        order = _derangement(len(takes), generator)
        return [
            effect.columns(with_context(take, takes[other]), settings, shape)
            for take, other in zip(takes, order, strict=True)
        ]
    if effect.decoy == "dealt wearings":
        names = [take.wearing for take in takes]
        dealt = generator.permutation(len(takes))
        return [
            effect.columns(replace(take, wearing=names[other]), settings, shape)
            for take, other in zip(takes, dealt, strict=True)
        ]
    return [np.zeros_like(effect.columns(take, settings, shape)) for take in takes]


def _reversed(take: Signals) -> Signals:
    return replace(
        take,
        time_s=take.time_s[-1] - take.time_s[::-1],
        own=take.own[::-1],
        others={name: values[::-1] for name, values in take.others.items()},
        context={name: values[::-1] for name, values in take.context.items()},
    )


def _rolled(take: Signals, generator: np.random.Generator) -> Signals:
    by = int(len(take) * generator.uniform(0.2, 0.8))
    return replace(
        take,
        others={name: np.roll(values, by) for name, values in take.others.items()},
        context={name: np.roll(values, by) for name, values in take.context.items()},
    )


def with_context(take: Signals, other: Signals) -> Signals:
    share, known = np.linspace(0, 1, len(take)), np.linspace(0, 1, len(other))
    return replace(
        take, context={name: np.interp(share, known, values) for name, values in other.context.items()}
    )


def _derangement(count: int, generator: np.random.Generator) -> np.ndarray:
    if count < 2:
        return np.arange(count)
    while True:
        order = generator.permutation(count)
        if (order != np.arange(count)).all():
            return order
