"""Is it the glove that slips? The slow error of a rotation as a sum of variance components, by likelihood.

The error's means over about 10 s are taken for a Gaussian process whose covariance is a sum: noise, the
wandering of a healthy glove that comes back, posture, one offset and gain of each wearing, a line and a
smooth curve over each recorded context column; and beside them what a slip does: a walk since donning, the
same way in every wearing or in each its own, a walk inside takes, an offset of each take, all of them also in
proportion to the bend. Variances are the likeliest ones (restricted maximum likelihood: Patterson & Thompson
1971). Every glove slips a little: held against the likeliest slip is one of ``EVERY_GLOVE_DEG`` at most in
each component, all else being free.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.effects.base.power_on import POWER_ON, evenly_since_power_on
from glovecal_models.effects.garment_slip.slip_rate import MEAN_S
from glovecal_models.regression.factorisation import potrf, potri
from glovecal_models.takes.take import Take

EVERY_GLOVE_DEG = 0.25
"""Of each component; a healthy glove's own wandering comes back, and is a component of its own."""
LIKELIER, FEW_JOINTS = 4.0, 5
"""Twice the log likelihood ratio from which on one joint alone slips; more with more joints, each a chance to
err."""
LARGE_DEG = 0.55
"""And at least one joint has to slip by more: of 310 simulated clean gloves that wander by 0.4 degrees ten
have a ratio above 4, up to 14, all of 0.54 degrees at most; of 14 that slip by 0.65 noise floors and are that
likely twelve slip by more, of twelve that slip by 1.3 eleven (2026-11-28)."""
TOGETHER_LIKELIER, EACH_LIKELIER, SOME_LIKELIER = 8.0, 0.7, 2.0
"""Joints of the last ratio slip where the ratios of all joints, few or fewer, add up to the first; to more by
the second for each further joint, three times the mean of clean gloves."""
ALIKE_LIKELIER = 1.0
"""Below, it is as of every glove."""
LEAST_SLOW_DEG = 0.35
"""Means that scatter by less hold no slip that is worth a name."""
FEWEST_SLOW_PIECES = 18
"""Of about 10 s. Of 244 healthy simulated gloves with 12 three were said to slip by half a degree
(2026-11-28)."""
HEALTHY_LASTS_S = 25.0
ALIKE_SD = 0.5
"""Bends within so many standard deviations have about one error of posture."""
CURVE_SD = 0.7
"""The same of a context column's curve."""
QUICK_SD = 0.2
"""Of a second one over the time since power-on: what is regulated swings while it warms up, each time alike.
Five simulated gloves whose heaters swing or whose amplifiers set themselves to zero were said to slip without
it, and with it none (2026-11-29)."""
NUGGET = 1e-2
"""Of the variance: keeps the covariance positive."""
LEAST_LOG, START_LOG, MOST_LOG = -7.0, -1.6, 3.0
LIKELIHOOD_ROUNDS = 60
SINCE_DONNING, SAME_WAY, INSIDE, BETWEEN = "since donning", "same way", "inside takes", "between takes"
SLIPS = (SINCE_DONNING, SAME_WAY, INSIDE, BETWEEN)
WORN = "wearing"
CONTEXT = "context "
"""Before a column's name."""


@dataclass(frozen=True)
class SlipComponents:
    """Of one rotation."""

    size_deg: float
    """Standard deviation over the session of all that is slip, no more than that of the error itself: what a
    curve and a walk take from each other in a few takes is in neither."""
    likelier: float
    """Twice the log of the likelihood ratio, against a slip as of every glove."""
    kind: str
    """The largest component, one of ``SLIPS``."""
    wearings_likelier: float
    """The same ratio for offsets and gains of the wearings beside the slip."""
    pieces: int


def slipping(slips: Sequence[SlipComponents | None]) -> tuple[int, ...]:
    """Which of all joints that were looked at slip: by what they show together, or each alone."""
    likelier = np.array([0.0 if slip is None else slip.likelier for slip in slips])
    is_large = np.array([slip is not None and slip.size_deg > LARGE_DEG for slip in slips])
    further = max(len(slips) - FEW_JOINTS, 0)
    some = likelier > SOME_LIKELIER
    if likelier.sum() > TOGETHER_LIKELIER + EACH_LIKELIER * further and np.any(some & is_large):
        return tuple(map(int, np.flatnonzero(some)))
    alone = likelier > LIKELIER + 2 * np.log1p(further / FEW_JOINTS)
    return tuple(map(int, np.flatnonzero(alone & is_large)))


def slip_components(
    takes: Sequence[Take], errors: Sequence[np.ndarray], angles: Sequence[np.ndarray]
) -> SlipComponents | None:
    """``errors`` (N,) of each take less what goes with posture, ``angles`` (N,) measured, degrees; NaN where
    there is no reference. None where there is too little to say, no slow error worth a name, or no more of a
    slip than every glove has."""
    pieces = slip_pieces(takes, errors, angles)
    if len(pieces.error) < FEWEST_SLOW_PIECES or pieces.error.std() < LEAST_SLOW_DEG:
        return None
    spread = float(pieces.error.std())
    parts = _covariances(pieces)
    likelihood = _Likelihood(parts, pieces.error / spread)
    most = 2 * np.log(EVERY_GLOVE_DEG / spread)
    slips = _slip_names(parts)
    held, start = likelihood.highest({name: most if name in slips else MOST_LOG for name in parts})
    free, logs = likelihood.highest(dict.fromkeys(parts, MOST_LOG), start)
    if 2 * (free - held) <= ALIKE_LIKELIER:
        return None
    variance = {name: spread**2 * float(np.exp(log)) for name, log in logs.items()}
    sizes = {kind: sum(variance[name] for name in _slip_names(parts) if name[0] == kind) for kind in SLIPS}
    without_wearings = {name: MOST_LOG if name[0] != WORN else LEAST_LOG for name in parts}
    worn_alike, _ = likelihood.highest(without_wearings, logs)
    return SlipComponents(
        size_deg=min(float(np.sqrt(sum(sizes.values()))), spread),
        likelier=2 * (free - held),
        kind=max(sizes, key=lambda kind: sizes[kind]),
        wearings_likelier=2 * (free - worn_alike),
        pieces=len(pieces.error),
    )


@dataclass(frozen=True)
class SlipOrCause:
    """What a slip of any size, and what follows recorded columns, make of the slow error of one rotation:
    twice the logs of likelihood ratios, 0 where there is too little to say, or no column of the cause that
    all takes know throughout."""

    with_cause: float = 0.0
    """Of both over the slip without the cause, other columns being free."""
    slip_over_cause: float = 0.0
    """Of the slip alone over the cause alone, with a slip as of every glove, without other columns."""

    @classmethod
    def of(
        cls,
        takes: Sequence[Take],
        errors: Sequence[np.ndarray],
        angles: Sequence[np.ndarray],
        context: Sequence[str],
    ) -> SlipOrCause:
        """``context``: the cause's columns; of no name: the wearings. Errors and angles as for
        ``slip_components``."""
        pieces = slip_pieces(takes, errors, angles)
        spread = float(pieces.error.std())
        if len(pieces.error) < FEWEST_SLOW_PIECES or spread == 0:
            return cls()
        parts = _covariances(pieces)
        likelihood = _Likelihood(parts, pieces.error / spread)
        columns = {name[0] for name in parts if name[0] == WORN or name[0].startswith(CONTEXT)}
        cause = {CONTEXT + name for name in context} if context else {WORN}
        if not cause & columns:
            return cls()

        def at_most(log: float, some: set[str]) -> dict[Name, float]:
            return {name: log if name[0] in some else MOST_LOG for name in parts}

        without, logs = likelihood.highest(at_most(LEAST_LOG, cause))
        begin = {name: START_LOG if name[0] in cause else log for name, log in logs.items()}
        both, _ = likelihood.highest(dict.fromkeys(parts, MOST_LOG), begin)
        slip, _ = likelihood.highest(at_most(LEAST_LOG, columns))
        as_every_glove = at_most(2 * np.log(EVERY_GLOVE_DEG / spread), set(SLIPS))
        no_others = {name: LEAST_LOG for name in parts if name[0] in columns - cause}
        alone, _ = likelihood.highest(as_every_glove | no_others)
        return cls(2 * (both - without), 2 * (slip - alone))


Name = tuple[str, str]
"""What a component follows, and how."""


def _slip_names(parts: Mapping[Name, np.ndarray]) -> list[Name]:
    return [name for name in parts if name[0] in SLIPS]


class _Likelihood:
    """Of errors (P,) under a sum of covariances (P, P) with free variances and an unknown mean."""

    def __init__(self, parts: Mapping[Name, np.ndarray], error: np.ndarray) -> None:
        count = len(error)
        contrasts = np.linalg.qr(np.column_stack([np.ones(count), np.eye(count)[:, 1:]]))[0][:, 1:]
        self._names = list(parts)
        self._error = contrasts.T @ error
        projected = [contrasts.T @ part @ contrasts * (count / np.trace(part)) for part in parts.values()]
        self._parts = np.array([part.ravel() for part in projected])
        self._nugget = NUGGET * np.eye(count - 1)

    def highest(
        self, most: Mapping[Name, float], start: Mapping[Name, float] | None = None
    ) -> tuple[float, dict[Name, float]]:
        """The log likelihood and the logs of the variances, each at most ``most``."""
        from scipy.optimize import minimize  # slow to load, and each service loads all effects

        bounds = [(LEAST_LOG, max(most[name], LEAST_LOG)) for name in self._names]
        begin = [START_LOG if start is None else start[name] for name in self._names]
        found = minimize(
            self._negative, np.clip(begin, *np.transpose(bounds)), jac=True, method="L-BFGS-B", bounds=bounds,
            options={"maxiter": LIKELIHOOD_ROUNDS},
        )  # fmt: skip
        return -float(found.fun), dict(zip(self._names, map(float, found.x), strict=True))

    def _negative(self, logs: np.ndarray) -> tuple[float, np.ndarray]:
        variances = np.exp(logs)
        covariance = (variances @ self._parts).reshape(self._nugget.shape) + self._nugget
        factor, failed = potrf(covariance, lower=1)
        if failed:
            return 1e9, np.zeros(len(logs))
        inverse = potri(factor, lower=1)[0]
        inverse = np.tril(inverse) + np.tril(inverse, -1).T
        solved = inverse @ self._error
        value = 0.5 * self._error @ solved + np.log(np.diag(factor)).sum()
        return float(value), -0.5 * variances * (self._parts @ (np.outer(solved, solved) - inverse).ravel())


def _covariances(pieces: SlipPieces) -> dict[Name, np.ndarray]:
    """(P, P) of every component; the scale of each is free."""
    count = len(pieces.error)
    worn = (pieces.wearing[:, None] == pieces.wearing[None, :]).astype(float)
    take = (pieces.take[:, None] == pieces.take[None, :]).astype(float)
    bend = _standard(pieces.bend)
    bent = np.outer(bend, bend)
    apart_s = np.abs(pieces.worn_s[:, None] - pieces.worn_s[None, :])
    since_donned = np.minimum(pieces.worn_s[:, None], pieces.worn_s[None, :])
    since_begun = np.minimum(pieces.inside_s[:, None], pieces.inside_s[None, :])
    found = {
        ("noise", ""): np.eye(count),
        ("healthy", ""): np.exp(-apart_s / HEALTHY_LASTS_S) * worn,
        ("posture", ""): _alike(bend, ALIKE_SD),
        (WORN, ""): worn,
        (WORN, "bend"): worn * bent,
    }
    for name, column in pieces.context.items():
        value = _standard(evenly_since_power_on(column) if name == POWER_ON else column)
        if name == POWER_ON:
            found[CONTEXT + name, "quick curve"] = _alike(value, QUICK_SD) * (1 + bent)
        found[CONTEXT + name, "line"] = np.outer(value, value) * (1 + bent)
        found[CONTEXT + name, "curve"] = _alike(value, CURVE_SD) * (1 + bent)
    found |= {
        (SINCE_DONNING, ""): since_donned * worn,
        (SINCE_DONNING, "bend"): since_donned * worn * bent,
        (SAME_WAY, ""): since_donned,
        (SAME_WAY, "bend"): since_donned * bent,
        (INSIDE, ""): since_begun * take,
        (BETWEEN, ""): take,
        (BETWEEN, "bend"): take * bent,
    }
    return found


def _alike(values: np.ndarray, within: float) -> np.ndarray:
    return np.exp(-0.5 * np.square((values[:, None] - values[None, :]) / within))


def _standard(values: np.ndarray) -> np.ndarray:
    return (values - values.mean()) / max(float(values.std()), 1e-9)


# An error's means over pieces of about 10 s, with the time since donning and what else was recorded.


MOST_PIECES = 160
FIRST_WORN_S = 30.0
"""A glove is recorded about so long after it was put on."""
PAUSE_S = 20.0
"""Between takes, where nothing tells the time."""
MEASURED_SHARE, COMPLETE_SHARE = 0.5, 0.9
"""A piece counts where so many of its frames were measured, and frames came in about as many of its seconds
as in those of the fullest. Not as many frames: where repeated ones were dropped, that would leave the few
pieces in which none were."""


@dataclass(frozen=True)
class SlipPieces:
    """Means over pieces of takes; each array (P,)."""

    error: np.ndarray
    bend: np.ndarray
    worn_s: np.ndarray
    """Since donning."""
    inside_s: np.ndarray
    """Since the take's first frame."""
    take: np.ndarray
    wearing: np.ndarray
    context: dict[str, np.ndarray]
    """Columns that every take knows throughout, and that vary."""


def slip_pieces(
    takes: Sequence[Take], errors: Sequence[np.ndarray], angles: Sequence[np.ndarray]
) -> SlipPieces:
    """Of about ``MEAN_S``, longer in long sessions."""
    lasts_s = MEAN_S * max(1.0, sum(take.duration_s for take in takes) / (MEAN_S * MOST_PIECES))
    names = _context_names(takes)
    rows: list[np.ndarray] = []
    for number, (take, begins_s) in enumerate(zip(takes, _worn_s(takes), strict=True)):
        piece = np.floor((take.time_s - take.time_s[0]) / lasts_s).astype(int)
        known = np.isfinite(errors[number]) & np.isfinite(angles[number])
        every, count = np.bincount(piece), np.bincount(piece, known)
        begins_second = np.diff(np.floor(take.time_s - take.time_s[0]), prepend=-1.0) > 0
        seconds = np.bincount(piece, begins_second)
        is_complete = seconds >= COMPLETE_SHARE * seconds.max()
        good = (count >= MEASURED_SHARE * every) & is_complete & (count > 0)
        columns = (errors[number], angles[number], *(take.context[name] for name in names))
        total = [np.bincount(piece, np.where(known, column, 0.0))[good] / count[good] for column in columns]
        middle = lasts_s * (np.flatnonzero(good) + 0.5)
        rows.append(np.column_stack([np.full(len(middle), number), begins_s + middle, middle, *total]))
    take_of, worn_s, inside_s, error, bend, *context = np.concatenate(rows).T
    wearings = list(dict.fromkeys(take.wearing for take in takes))
    wearing = np.array([wearings.index(takes[int(number)].wearing) for number in take_of])
    columns = zip(names, context, strict=True)
    varied = {name: column for name, column in columns if column.size and np.ptp(column) > 1e-9}
    return SlipPieces(error, bend, worn_s, inside_s, take_of, wearing, varied)


def _context_names(takes: Sequence[Take]) -> list[str]:
    """Columns that every take knows throughout."""
    names = takes[0].context if takes else {}
    return [n for n in names if all(n in t.context and np.isfinite(t.context[n]).all() for t in takes)]


def _worn_s(takes: Sequence[Take]) -> list[float]:
    """How long the glove was worn when each take began, by the time since power-on where it was recorded."""
    found, last = [], {}
    for take in takes:
        on = take.context.get(POWER_ON)
        now = float(on[0]) if on is not None and np.isfinite(on[0]) else None
        begins_s = FIRST_WORN_S
        if take.wearing in last:
            began_s, power_s, lasted_s = last[take.wearing]
            begins_s = began_s + lasted_s + PAUSE_S
            if now is not None and power_s is not None:
                went_on = now - power_s >= lasted_s
                begins_s = began_s + now - power_s if went_on else began_s + lasted_s + now
        found.append(begins_s)
        last[take.wearing] = (begins_s, now, take.duration_s)
    return found
