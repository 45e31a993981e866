"""How often is an effect of known size named, when it is put into the session and that is diagnosed again?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from glovecal_models.diagnosis.detectability.injection import (
    injected,
    injected_takes,
    where_injected,
    why_not_injected,
)
from glovecal_models.diagnosis.detectability.surrogate_session import SurrogateSession
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.effects.base.effect import Effect
from glovecal_models.progress import Cancel

Outcome = Literal["named", "ambiguous", "mistaken", "not found"]
SIZES_DEG = (0.5, 1.0, 2.0, 4.0)
TRIALS = 3
BOUND_LEVEL = 0.95


@dataclass(frozen=True)
class Trial:
    """One diagnosis of the session with an effect put in."""

    outcome: Outcome
    named: tuple[str, ...]
    """The confidence set, the effect named first in front; empty where nothing was named."""


@dataclass(frozen=True)
class SizeTried:
    """All trials of one size."""

    size_deg: float
    trials: tuple[Trial, ...]
    """Empty: these takes cannot hold so much of the effect."""

    def count(self, *outcomes: Outcome) -> int:
        return sum(trial.outcome in outcomes for trial in self.trials)

    def share(self, *outcomes: Outcome) -> float:
        return self.count(*outcomes) / max(len(self.trials), 1)

    @property
    def mistaken_for(self) -> Mapping[str, int]:
        """Effects named instead, and how often."""
        return Counter(trial.named[0] for trial in self.trials if trial.outcome == "mistaken")


@dataclass(frozen=True)
class Detectability:
    """How large one effect has to be on some rotations to be named in this session."""

    effect: str
    rotations: tuple[str, ...]
    """On which it was put in, all at once."""
    sizes: tuple[SizeTried, ...] = ()
    why_not: str | None = None
    """Why it cannot be put in or found; no size was tried then."""

    def size_deg(self, probability: float, *outcomes: Outcome) -> float | None:
        """The smallest size that ends in one of ``outcomes`` with ``probability``; None: none that was tried.

        Shares of trials, made monotone in size and interpolated over its logarithm. Where the smallest size
        that was tried does, that size: it may be smaller.
        """
        tried = [item for item in self.sizes if item.trials]
        shares = _monotone([item.share(*outcomes) for item in tried], [len(item.trials) for item in tried])
        for number, (item, share) in enumerate(zip(tried, shares, strict=True)):
            if share < probability:
                continue
            if number == 0:
                return item.size_deg
            before, low = tried[number - 1].size_deg, shares[number - 1]
            part = (probability - low) / (share - low)
            return float(np.exp(np.log(before) + part * (np.log(item.size_deg) - np.log(before))))
        return None


@dataclass(frozen=True)
class Control:
    """The same trials with nothing put in: what is named then is named by chance, or for want of fit."""

    trials: tuple[Trial, ...]

    @property
    def named(self) -> Mapping[str, int]:
        return Counter(trial.named[0] for trial in self.trials if trial.named)


def trial(
    session: SurrogateSession,
    effect: Effect | None,
    rotations: Sequence[str],
    size_deg: float,
    *,
    seed: int = 0,
    cancelled: Cancel | None = None,
) -> Trial | None:
    """``effect`` None: nothing is put in. None where these takes cannot hold so much of it.

    The noise depends on the seed alone: the trials of all sizes and effects of a seed have the same. Raises
    BadInput, Cancelled.
    """
    noise, drawn = np.random.default_rng([seed, 1]), np.random.default_rng([seed, 2])
    item = None if effect is None else injected(session, effect, rotations, size_deg, drawn)
    if effect is not None and item is None:
        return None
    found = replace(session.on, takes=injected_takes(session, item, noise)).diagnosed(
        signatures=False,
        judge_residual=False,
        noise_floors={},
        seed=seed,
        limits=session.limits,
        cancelled=cancelled,
    )
    where = session.rotations if item is None or not item.added else tuple(item.added)
    return Trial(_outcome(found, None if effect is None else effect.name, where), found.naming.confidence_set)


def _outcome(found: Diagnosis, effect: str | None, rotations: Sequence[str]) -> Outcome:
    """It counts as found where it is significant on a rotation that it was put in."""
    members = found.naming.confidence_set
    if not members:
        return "not found"
    item = next((item for item in found.naming.ranked if item.effect == effect), None)
    where = set() if item is None else {item.joints[i] for i in item.significant_joints}
    if effect not in members or not where & set(rotations):
        return "mistaken"
    return "named" if len(members) == 1 else "ambiguous"


def detectability(
    session: SurrogateSession,
    effect: Effect,
    rotations: Sequence[str] | None = None,
    sizes_deg: Sequence[float] = SIZES_DEG,
    *,
    trials: int = TRIALS,
    seed: int = 0,
    cancelled: Cancel | None = None,
) -> Detectability:
    """``rotations``: put in there at once; None: on all that have a sensor of their own.

    Raises BadInput, Cancelled.
    """
    where = where_injected(session, effect, rotations)
    why = why_not_injected(session, effect)
    if why is not None:
        return Detectability(effect.name, where, why_not=why)
    found = []
    for size in sorted(sizes_deg):
        each = [
            trial(session, effect, where, size, seed=seed + number, cancelled=cancelled)
            for number in range(trials)
        ]
        found.append(SizeTried(size, tuple(item for item in each if item is not None)))
    return Detectability(effect.name, where, tuple(found))


def lowest_probability(trials: int) -> float:
    """The one-sided lower 95 % bound of a probability that held in every one of so many trials."""
    return (1 - BOUND_LEVEL) ** (1 / trials) if trials else 0.0


def _monotone(shares: Sequence[float], weights: Sequence[int]) -> list[float]:
    """The nearest shares that do not fall (pool adjacent violators)."""
    pools: list[list[float]] = []
    for share, weight in zip(shares, weights, strict=True):
        pools.append([share, float(weight), 1.0])
        while len(pools) > 1 and pools[-2][0] > pools[-1][0]:
            value, size, count = pools.pop()
            before = pools[-1]
            before[0] = (before[0] * before[1] + value * size) / (before[1] + size)
            before[1] += size
            before[2] += count
    return [value for value, _, count in pools for _ in range(int(count))]
