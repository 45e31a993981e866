"""How readings drift while a pose is held: creep, a hand that relaxes, or warm-up?

Without a measured angle a sensor that creeps and a hand that relaxes look the same. Warm-up does not: it goes
on in one direction through all poses, and does not begin anew with each hold.

Each hold is fitted, sensor by sensor, with a level and b (1 - exp(-t / tau)) / (1 - exp(-T / tau)); b is the
change within the hold of length T, and tau is common to all holds and sensors of a pose. A randomization test
flips the sign of whole holds, of all their sensors at once: readings within a hold are far from independent,
and the sensors of one hand drift together. Under the null hypothesis a drift has either sign, and speeds up
as often as it slows down.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.diagnosis.hold_answer import HoldVerdict
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.posed_holds import PosedHold, posed_holds
from glovecal_models.effects.base.facts import HoldDrift as HoldDriftKind
from glovecal_models.effects.catalogue import catalogue
from glovecal_models.takes.take import Take

GRID = 1.35
SHORTEST_TAU_S = 0.7


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
class HoldFit:
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
    def of(cls, held: Sequence[PosedHold]) -> HoldFit:
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


DRAWN = 4000
"""Sign flips of the holds; all of them when there are fewer."""


def p_value_of(fits: Sequence[HoldFit], generator: np.random.Generator) -> float:
    """The smaller of two, doubled: holds with flipped sign, and holds also reversed in time."""
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


HAND = "hand_relaxing"
"""No effect of the glove: the wearer's hand gives way."""
RIGID = "rigid"
"""Begins the names of poses held around a rigid form: there the hand cannot relax."""


@dataclass(frozen=True)
class HoldDrift:
    """The drift within holds of poses, or why it cannot be judged."""

    sensors: tuple[str, ...]
    poses: tuple[PoseDrift, ...]
    """Those held at least ``hold_fewest_of_a_pose`` times, the one that drifts most first."""
    holds: int
    p_value: float
    """Of the drift that the holds have in common, by flipping the sign of whole holds."""
    elsewhere: float | None
    """How fast readings drift in poses far from the first, as a share of how fast they do there: warm-up goes
    on (1), a sensor or hand that goes back turns around (negative). None when there is no such pose, or when
    its holds differ too much to decide."""
    far: tuple[str, ...]
    """Those poses."""
    recovery: float | None
    """Share of a hold's drift that is gone when the pose comes back in the same take; None when none does."""
    confidence_set: tuple[str, ...] = ()
    """Empty when nothing drifts significantly; a cause is alone only after holds of a rigid form."""
    why_not: str | None = None
    """Why it cannot be judged."""
    deg_of_span: Mapping[str, float] | None = None
    """Degrees that a sensor's span stands for, where angles are known."""
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS

    @property
    def verdict(self) -> HoldVerdict:
        if self.why_not is not None:
            return "not_identifiable"
        if not self.confidence_set:
            return "nothing"
        return "named" if len(self.confidence_set) == 1 else "ambiguous"

    def change_deg(self, sensor: str, share: float) -> float | None:
        """A share of a sensor's span in degrees, where angles are known."""
        span = (self.deg_of_span or {}).get(sensor)
        return None if span is None else share * span

    def consistent(self, pose: PoseDrift) -> list[tuple[str, float]]:
        """Sensors that drift one way in most holds of a pose with their signed shares, the largest first."""
        limits = self.limits
        is_large = np.abs(pose.share) >= limits.hold_least_share
        sure = is_large & (pose.same_sign >= limits.hold_one_way_share * pose.holds)
        order = [i for i in np.argsort(-np.abs(pose.share)) if sure[i]]
        return [(self.sensors[i], float(pose.share[i])) for i in order]


def hold_drift(
    takes: Sequence[Take],
    sensors: Sequence[str],
    *,
    deg_of_span: Mapping[str, float] | None = None,
    seed: int = 0,
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS,
) -> HoldDrift:
    """Judge the drift of ``sensors`` within the poses held in ``takes``."""
    every = posed_holds(takes, sensors, limits)
    names = list(dict.fromkeys(hold.pose for hold in every))
    by_pose = {name: [hold for hold in every if hold.pose == name] for name in names}
    fewest = limits.hold_fewest_of_a_pose
    repeated = {name: held for name, held in by_pose.items() if len(held) >= fewest}
    count = sum(len(held) for held in repeated.values())
    why_not = _why_not(len(every), len(names), count, takes, limits)
    if why_not is not None:
        return HoldDrift(tuple(sensors), (), count, 1.0, None, (), None, why_not=why_not, limits=limits)
    fits = [HoldFit.of(held) for held in repeated.values()]
    poses = sorted((fit.in_common() for fit in fits), key=lambda item: -float(np.abs(item.share).mean()))
    drift = HoldDrift(
        tuple(sensors),
        tuple(poses),
        count,
        p_value_of(fits, np.random.default_rng(seed)),
        _elsewhere(fits, limits),
        tuple(fit.held[0].pose for fit in _far(fits, limits.hold_far_share)),
        _recovery(fits, limits),
        deg_of_span=deg_of_span,
        limits=limits,
    )
    return replace(drift, confidence_set=_decided(_causes(drift), fits, seed, limits))


def _why_not(
    holds: int, poses: int, repeated: int, takes: Sequence[Take], limits: DiagnosisLimits
) -> str | None:
    if not holds:
        return f"no pose is held still for {limits.hold_shortest_s:g} s"
    moves = any(take.poses is not None and "" in take.poses for take in takes)
    if poses < 2 and not moves and all(take.poses is not None for take in takes):
        return "only one pose was recorded, so the sensors' span is unknown"
    if repeated < limits.hold_fewest:
        times = limits.hold_fewest_of_a_pose
        return f"{repeated} holds are of poses held at least {times} times; {limits.hold_fewest} are needed"
    return None


def _first(fits: Sequence[HoldFit]) -> PoseDrift:
    """Of the pose that drifts most."""
    return max((fit.in_common() for fit in fits), key=lambda item: float(np.abs(item.share).mean()))


def _far(fits: Sequence[HoldFit], far_share: float) -> list[HoldFit]:
    """Poses far from that which drifts most."""
    level = _first(fits).level
    return [fit for fit in fits if np.abs(fit.in_common().level - level).mean() > far_share]


def _elsewhere(fits: Sequence[HoldFit], limits: DiagnosisLimits) -> float | None:
    """See ``HoldDrift.elsewhere``; each hold of a far pose is one witness."""
    first, far = _first(fits), _far(fits, limits.hold_far_share)
    if not far:
        return None
    rate = first.share / first.duration_s
    changes = [
        change / hold.duration_s for fit in far for hold, change in zip(fit.held, fit.changes, strict=True)
    ]
    found = np.array([change @ rate for change in changes]) / max(rate @ rate, 1e-24)
    error = float(found.std(ddof=1)) / np.sqrt(len(found))
    away = abs(found.mean() - limits.hold_half)
    return float(found.mean()) if away > limits.hold_decided_se * error else None


def _recovery(fits: Sequence[HoldFit], limits: DiagnosisLimits) -> float | None:
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
    if len(pairs) < limits.hold_fewest_of_a_pose:
        return None
    gone, whole = pairs.sum(axis=0)
    found = gone / max(whole, 1e-24)
    others = (gone - pairs[:, 0]) / np.maximum(whole - pairs[:, 1], 1e-24)
    error = np.sqrt((len(pairs) - 1) * np.mean((others - others.mean()) ** 2))
    return float(found) if abs(found - limits.hold_half) > limits.hold_decided_se * error else None


def _causes(drift: HoldDrift) -> tuple[str, ...]:
    """What could bring the drift about; nothing when there is no significant one."""
    largest = max(float(np.abs(item.share).max()) for item in drift.poses)
    limits, half = drift.limits, drift.limits.hold_half
    if drift.p_value > limits.hold_p_value or largest < limits.hold_least_share:
        return ()
    goes_on = drift.elsewhere is None or drift.elsewhere >= half
    if drift.recovery is not None and drift.recovery < half and goes_on:
        return _over_time()
    if (drift.recovery is not None and drift.recovery >= half) or not goes_on:
        return _with_the_hold()
    slows = sum(item.is_slowing for item in drift.poses) > drift.holds / 2
    if drift.elsewhere is not None and (not slows or drift.poses[0].tau_is_long):
        return _over_time()
    return (*_with_the_hold(), *drifting("slows down"))


def drifting(how: HoldDriftKind) -> tuple[str, ...]:
    """Effects that make readings drift so while a pose is held."""
    each = ((name, item.about.in_holds) for name, item in catalogue().items())
    return tuple(name for name, drift in each if drift is not None and drift.how == how)


def _with_the_hold() -> tuple[str, ...]:
    return (*drifting("begins anew with each hold"), HAND)


def _over_time() -> tuple[str, ...]:
    return (*drifting("slows down"), *drifting("goes on"))


def _decided(
    causes: tuple[str, ...], fits: Sequence[HoldFit], seed: int, limits: DiagnosisLimits
) -> tuple[str, ...]:
    """Holds around a rigid form decide: there the hand cannot relax."""
    rigid = [fit for fit in fits if fit.held[0].pose.startswith(RIGID)]
    free = [fit for fit in fits if fit not in rigid]
    count = sum(len(fit.held) for fit in rigid)
    if not set(_with_the_hold()) <= set(causes) or count < limits.hold_fewest:
        return causes
    size = max(float(np.abs(fit.changes.mean(axis=0)).mean()) for fit in rigid)
    p_value = p_value_of(rigid, np.random.default_rng(seed))
    if size >= limits.hold_least_share and p_value <= limits.hold_p_value:
        return drifting("begins anew with each hold")
    others = max((float(np.abs(fit.changes.mean(axis=0)).mean()) for fit in free), default=0.0)
    return (HAND,) if size < limits.hold_half * others else causes
