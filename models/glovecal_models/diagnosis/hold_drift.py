"""How readings drift while a pose is held: creep, a hand that relaxes, or warm-up?

Each hold of a pose is fitted, sensor by sensor, with a level and b (1 - exp(-t / tau)) / (1 - exp(-T / tau));
b is the change within the hold of length T, and tau is common to all holds and sensors of a pose. Readings
within a hold are far from independent, and the sensors of one hand drift together: a whole hold is the unit.
Holds are turned upside down at random, and reversed in time as well, all their sensors at once: a drift that
is there by chance has either sign, and speeds up as often as it slows down.

Without a measured angle a sensor that creeps and a hand that relaxes look the same. Warm-up does not: it goes
on in one direction through all poses, and does not begin anew with each hold.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.diagnosis.posed_holds import PosedHold, posed_holds
from glovecal_models.takes.take import Take

FEWEST_HOLDS = 4
"""With fewer, turning whole holds around cannot bring chance far below 1 in 20."""
FEWEST_OF_A_POSE = 3
SURE = 0.05
LEAST_SHARE = 0.01
"""Of a sensor's span; a smaller drift is not worth a name."""
DRAWN = 4000
"""Ways to turn the holds around; all of them when there are fewer."""
GRID = 1.35
SHORTEST_TAU_S = 0.7
HALF = 0.5
DECIDED = 2.0
"""Standard errors from one half."""
FAR_SHARE = 0.4
"""Of the spans, mean over the sensors: poses so far apart are reached from opposite sides."""
WITH_THE_HOLD = ("creep", "hand_relaxing")
WITH_TIME = ("warmup_drift", "garment_slip")
RIGID = "rigid"
"""Begins the names of poses held around a rigid form: there the hand cannot relax."""


@dataclass(frozen=True)
class PoseDrift:
    """What all holds of one pose have in common."""

    pose: str
    holds: int
    duration_s: float
    """Median."""
    tau_s: float
    is_slowing: int
    """Holds that a slowing drift fits better than the same drift reversed in time."""
    share: np.ndarray
    """(S,) mean change within a hold, of the sensor's span, signed."""
    same_sign: np.ndarray
    """(S,) holds whose change has the sign of the mean."""
    level: np.ndarray
    """(S,) mean reading of the pose, in spans."""

    @property
    def tau_is_long(self) -> bool:
        """Whether the drift hardly slows down within the holds: its time constant is a lower bound."""
        return self.tau_s > 0.8 * self.duration_s


@dataclass(frozen=True)
class HoldDrift:
    """The drift within holds of poses, or why it cannot be judged."""

    sensors: tuple[str, ...]
    poses: tuple[PoseDrift, ...]
    """Those held at least ``FEWEST_OF_A_POSE`` times, the one that drifts most first."""
    holds: int
    probability: float
    """That holds whose drift has either sign drift so much alike."""
    elsewhere: float | None
    """How fast readings drift in poses far from the first, as a share of how fast they do there: warm-up goes
    on (1), a sensor or hand that goes back turns around (negative). None when there is no such pose, or when
    its holds differ too much to decide."""
    far: tuple[str, ...]
    """Those poses."""
    recovery: float | None
    """Share of a hold's drift that is gone when the pose comes back in the same take; None when none does."""
    confidence_set: tuple[str, ...] = ()
    """Empty when nothing drifts beyond chance; a cause is alone only after holds of a rigid form."""
    why_not: str | None = None
    """Why it cannot be judged."""
    deg_of_span: Mapping[str, float] | None = None
    """Degrees that a sensor's span stands for, where angles are known."""

    @property
    def is_drifting(self) -> bool:
        return bool(self.confidence_set)


def hold_drift(
    takes: Sequence[Take],
    sensors: Sequence[str],
    *,
    deg_of_span: Mapping[str, float] | None = None,
    seed: int = 0,
) -> HoldDrift:
    """Judge the drift of ``sensors`` within the poses held in ``takes``."""
    every = posed_holds(takes, sensors)
    names = list(dict.fromkeys(hold.pose for hold in every))
    by_pose = {name: [hold for hold in every if hold.pose == name] for name in names}
    repeated = {name: held for name, held in by_pose.items() if len(held) >= FEWEST_OF_A_POSE}
    count = sum(len(held) for held in repeated.values())
    why_not = _why_not(len(every), len(names), count, takes)
    if why_not is not None:
        return HoldDrift(tuple(sensors), (), count, 1.0, None, (), None, why_not=why_not)
    fits = [_Fit.of(held) for held in repeated.values()]
    poses = sorted((fit.in_common() for fit in fits), key=lambda item: -float(np.abs(item.share).mean()))
    drift = HoldDrift(
        tuple(sensors),
        tuple(poses),
        count,
        _probability(fits, np.random.default_rng(seed)),
        _elsewhere(fits),
        tuple(fit.held[0].pose for fit in _far(fits)),
        _recovery(fits),
        deg_of_span=deg_of_span,
    )
    return replace(drift, confidence_set=_decided(_causes(drift), fits, seed))


def _why_not(holds: int, poses: int, repeated: int, takes: Sequence[Take]) -> str | None:
    if not holds:
        return "no pose is held still for 8 s"
    moves = any(take.poses is not None and "" in take.poses for take in takes)
    if poses < 2 and not moves and all(take.poses is not None for take in takes):
        return "only one pose was recorded, so the sensors' span is unknown"
    if repeated < FEWEST_HOLDS:
        return (
            f"{repeated} holds are of poses held at least {FEWEST_OF_A_POSE} times; {FEWEST_HOLDS} are needed"
        )
    return None


@dataclass(frozen=True)
class _Fit:
    """All holds of one pose, fitted with one time constant."""

    held: tuple[PosedHold, ...]
    tau_s: float
    changes: np.ndarray
    """(H, S) within each hold."""
    levels: np.ndarray
    """(H, S) at the beginning of each."""
    reversed_changes: np.ndarray
    """(H, S) as they would be had time run backwards."""
    is_slowing: int

    @classmethod
    def of(cls, held: Sequence[PosedHold]) -> _Fit:
        longest = max(hold.duration_s for hold in held)
        steps = int(np.log(longest / SHORTEST_TAU_S) / np.log(GRID)) + 1
        taus = SHORTEST_TAU_S * GRID ** np.arange(steps)
        tau = float(
            min(taus, key=lambda tau: sum(_fitted(hold, _course(hold.time_s, tau))[2] for hold in held))
        )
        fits = [_fitted(hold, _course(hold.time_s, tau)) for hold in held]
        turned = [_fitted(hold, 1.0 - _course(hold.time_s[-1] - hold.time_s, tau)) for hold in held]
        return cls(
            tuple(held),
            tau,
            np.array([fit[1] for fit in fits]),
            np.array([fit[0] for fit in fits]),
            -np.array([fit[1] for fit in turned]),
            sum(fit[2] < other[2] for fit, other in zip(fits, turned, strict=True)),
        )

    def in_common(self) -> PoseDrift:
        share = self.changes.mean(axis=0)
        return PoseDrift(
            self.held[0].pose,
            len(self.held),
            float(np.median([hold.duration_s for hold in self.held])),
            self.tau_s,
            self.is_slowing,
            share,
            (np.sign(self.changes) == np.sign(share)).sum(axis=0),
            (self.levels + 0.5 * self.changes).mean(axis=0),
        )


def _course(time_s: np.ndarray, tau: float) -> np.ndarray:
    """From 0 at the beginning of a hold to 1 at its end."""
    return np.expm1(-time_s / tau) / np.expm1(-time_s.max() / tau)


def _fitted(hold: PosedHold, course: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """(S,) levels at course 0, (S,) changes, and the sum of squares left."""
    columns = np.column_stack([np.ones(len(course)), course])
    weights, *_ = np.linalg.lstsq(columns, hold.readings, rcond=None)
    return weights[0], weights[1], float(np.sum((hold.readings - columns @ weights) ** 2))


def _probability(fits: Sequence[_Fit], generator: np.random.Generator) -> float:
    """The smaller of two, doubled: holds turned upside down, and holds also reversed in time."""
    upside = [np.stack([fit.changes, -fit.changes]) for fit in fits]
    reversed_too = [
        np.stack([fit.changes, -fit.changes, fit.reversed_changes, -fit.reversed_changes]) for fit in fits
    ]
    return min(1.0, 2.0 * min(_chance(ways, generator) for ways in (upside, reversed_too)))


def _chance(ways: Sequence[np.ndarray], generator: np.random.Generator) -> float:
    """Share of draws as common as the changes are; ``ways``: for each pose (W, H, S), as they are first."""
    count, kinds = sum(part.shape[1] for part in ways), len(ways[0])
    if kinds**count <= DRAWN:
        chosen = np.array(list(itertools.product(range(kinds), repeat=count)))
    else:
        chosen = generator.integers(0, kinds, (DRAWN, count))
        chosen[0] = 0
    common, start = np.zeros(len(chosen)), 0
    for part in ways:
        holds = np.arange(part.shape[1])
        total = part[chosen[:, start + holds], holds].sum(axis=1)
        common += (total**2 / np.maximum((part[0] ** 2).sum(axis=0), 1e-24)).sum(axis=1)
        start += part.shape[1]
    return float(np.mean(common >= common[0] * (1 - 1e-9)))


def _first(fits: Sequence[_Fit]) -> PoseDrift:
    """Of the pose that drifts most."""
    return max((fit.in_common() for fit in fits), key=lambda item: float(np.abs(item.share).mean()))


def _far(fits: Sequence[_Fit]) -> list[_Fit]:
    """Poses far from that which drifts most."""
    level = _first(fits).level
    return [fit for fit in fits if np.abs(fit.in_common().level - level).mean() > FAR_SHARE]


def _elsewhere(fits: Sequence[_Fit]) -> float | None:
    """See ``HoldDrift.elsewhere``; each hold of a far pose is one witness."""
    first, far = _first(fits), _far(fits)
    if not far:
        return None
    rate = first.share / first.duration_s
    changes = [
        change / hold.duration_s for fit in far for hold, change in zip(fit.held, fit.changes, strict=True)
    ]
    found = np.array([change @ rate for change in changes]) / max(rate @ rate, 1e-24)
    error = float(found.std(ddof=1)) / np.sqrt(len(found))
    return float(found.mean()) if abs(found.mean() - HALF) > DECIDED * error else None


def _recovery(fits: Sequence[_Fit]) -> float | None:
    """From pairs of holds of a pose that follow each other in one take; None when they do not decide.

    A hand never takes a pose twice alike: what the levels differ by for that reason shows in how far the
    pairs differ (leaving one out at a time).
    """
    pairs = np.array(
        [
            (float((change - (after - before)) @ change), float(change @ change))
            for fit in fits
            for held, following, change, before, after in zip(
                fit.held, fit.held[1:], fit.changes, fit.levels, fit.levels[1:], strict=False
            )
            if held.take == following.take
        ]
    )
    if len(pairs) < FEWEST_OF_A_POSE:
        return None
    gone, whole = pairs.sum(axis=0)
    found = gone / max(whole, 1e-24)
    others = (gone - pairs[:, 0]) / np.maximum(whole - pairs[:, 1], 1e-24)
    error = np.sqrt((len(pairs) - 1) * np.mean((others - others.mean()) ** 2))
    return float(found) if abs(found - HALF) > DECIDED * error else None


def _causes(drift: HoldDrift) -> tuple[str, ...]:
    """What could bring the drift about; nothing when there is none beyond chance."""
    largest = max(float(np.abs(item.share).max()) for item in drift.poses)
    if drift.probability > SURE or largest < LEAST_SHARE:
        return ()
    goes_on = drift.elsewhere is None or drift.elsewhere >= HALF
    if drift.recovery is not None and drift.recovery < HALF and goes_on:
        return WITH_TIME
    if (drift.recovery is not None and drift.recovery >= HALF) or not goes_on:
        return WITH_THE_HOLD
    slows = sum(item.is_slowing for item in drift.poses) > drift.holds / 2
    if drift.elsewhere is not None and (not slows or drift.poses[0].tau_is_long):
        return WITH_TIME
    return (*WITH_THE_HOLD, WITH_TIME[0])


def _decided(causes: tuple[str, ...], fits: Sequence[_Fit], seed: int) -> tuple[str, ...]:
    """Holds around a rigid form decide: there the hand cannot relax."""
    rigid = [fit for fit in fits if fit.held[0].pose.startswith(RIGID)]
    free = [fit for fit in fits if fit not in rigid]
    if not set(WITH_THE_HOLD) <= set(causes) or sum(len(fit.held) for fit in rigid) < FEWEST_HOLDS:
        return causes
    size = max(float(np.abs(fit.changes.mean(axis=0)).mean()) for fit in rigid)
    if size >= LEAST_SHARE and _probability(rigid, np.random.default_rng(seed)) <= SURE:
        return ("creep",)
    others = max((float(np.abs(fit.changes.mean(axis=0)).mean()) for fit in free), default=0.0)
    return ("hand_relaxing",) if size < HALF * others else causes
