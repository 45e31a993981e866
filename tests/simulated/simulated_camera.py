"""A simulated camera as a reference: what it says of a hand whose angles are known.

No picture is made. What its errors are like was measured with the real tracker on rendered label images:
hands of other bones and radii than the model's in gloves that lay as printed, their shape fitted first;
labels spoilt as a classifier spoils them; two cameras 60 degrees apart, stage dense, 16 hands for 10 s each.
Hands that another program draws (``python3 do.py study camera-errors``), in gloves that lie aside, are
tracked less well: ``ON_OTHER_HANDS``. The errors last for almost a second, are as large as stated, and lean
to the mean of a prior that predicts each joint from the others. With one camera the stated deviations are 1.2
to 3.3 times as large; where no shape was fitted, true deviations are 1.4 times the stated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.takes.camera_estimates import CameraEstimates

USUAL_RANGE_DEG = (-10.0, 90.0)


@dataclass(frozen=True)
class JointErrors:
    """Of one kind of joint."""

    stated_sd_deg: float
    """Median over frames."""
    over_stated: float
    """True deviation, in those that are stated."""
    lean: float
    """Of the true deviation, along the way to the prior's mean: regression of errors on it."""


ERRORS = {
    "MCP": JointErrors(2.0, 0.75, 0.42),
    "PIP": JointErrors(3.2, 0.87, 0.61),
    "DIP": JointErrors(6.9, 1.22, 0.82),
    "IP": JointErrors(3.8, 1.12, 0.79),
    "TMC": JointErrors(1.0, 0.88, 0.16),
    "ABD": JointErrors(1.7, 0.84, 0.60),
    "VIR": JointErrors(3.5, 0.74, 0.63),
}
"""By the end of a rotation's name."""
ELSEWHERE = {
    "MCP": JointErrors(5.0, 0.80, 0.18),
    "PIP": JointErrors(4.9, 0.83, 0.13),
    "DIP": JointErrors(4.8, 1.02, 0.49),
    "IP": JointErrors(9.5, 1.14, 0.71),
    "TMC": JointErrors(5.8, 1.04, 0.23),
    "ABD": JointErrors(3.0, 1.00, 0.29),
    "VIR": JointErrors(7.9, 1.45, 0.57),
}
"""Of eight hands that another program draws (seeds 9200 to 9207), two cameras, their shape fitted."""
FLEXION_POWER, SPREAD_S = 2.5, 1.5
"""How steeply a deviation grows along the active range, if it does; how long one above the usual lasts."""
_OTHER = JointErrors(3.0, 0.93, 0.59)
"""Of a joint whose kind is not known; the means over all."""


@dataclass(frozen=True)
class SimulatedCamera:
    """What decides over its errors; degrees, seconds."""

    rate_hz: float = 30.0
    offset_s: float = 0.08
    """Camera time less glove time."""
    stated_times: float = 1.0
    """Stated deviations, in those that were measured."""
    spread: float = 0.2
    """Of the logarithm of a joint's stated deviation, over time."""
    flexion_times: float = 1.0
    """The stated deviation at full flexion, in those of the straight joint: none was measured to grow."""
    away_times: float = 1.5
    """The stated deviation while the hand is turned away, in those of plain view."""
    lasting_s: float = 0.8
    """Time within which errors count as one sample: twice the time constant of their correlation."""
    lean: float | None = None
    """Part of the deviation that leans to the prior's mean; None: as measured, by the kind of joint."""
    stays: float = 0.15
    """Part of the deviation that is the same as long as the hand is; the rest is chance."""
    hand: int = 0
    """Whose hand it is: decides what stays."""
    accepted_below_deg: float = 5.0
    over_stated: float | None = None
    """True deviation over the stated one; 1: calibrated; None: as measured, by the kind of joint."""
    dropped: float = 0.01
    """Share of frames that are lost."""
    errors: Mapping[str, JointErrors] = field(default_factory=lambda: ERRORS)
    """By the kind of joint."""

    def see(
        self, time_s: np.ndarray, angles_deg: np.ndarray, rotations: tuple[str, ...], seed: int
    ) -> CameraEstimates:
        """Estimates of a hand with ``angles_deg`` (N, K) at glove times ``time_s`` (N,), all simulated.

        The same arguments give the same estimates.
        """
        random = np.random.default_rng([seed, 71])
        first = float(time_s[0]) + random.uniform(0.0, 1.0 / self.rate_hz)
        at = np.arange(first, float(time_s[-1]), 1.0 / self.rate_hz)
        at = at[random.random(len(at)) >= self.dropped]
        truth = np.column_stack([np.interp(at, time_s, column) for column in angles_deg.T])
        away = self._away(at, random)
        sd = self._deviation(truth, rotations, away)
        if self.spread:
            sd *= np.exp(self.spread * lasting_noise(at, sd.shape[1], SPREAD_S, random))
        chance = lasting_noise(at, sd.shape[1], self.lasting_s / 2.0, random)
        kinds = [self._of_kind(name) for name in rotations]
        lean = np.array([kind.lean if self.lean is None else self.lean for kind in kinds])
        over = np.array(
            [kind.over_stated if self.over_stated is None else self.over_stated for kind in kinds]
        )
        staying = np.random.default_rng([self.hand, 72]).standard_normal(len(rotations))
        left = np.sqrt(np.maximum(0.0, 1.0 - lean**2 - self.stays**2))
        error = left * chance + lean * towards_prior(truth) + self.stays * staying
        patches = np.round(14.0 - 6.0 * away + 0.7 * random.standard_normal(len(at))).clip(3, 20)
        return CameraEstimates(
            time_s=at + self.offset_s,
            rotations=rotations,
            angles_deg=truth + over * sd * error,
            sd_deg=sd,
            accepted=sd < self.accepted_below_deg,
            patches=patches.astype(int),
            simulated=True,
        )

    def _of_kind(self, name: str) -> JointErrors:
        return next((errors for kind, errors in self.errors.items() if name.endswith(kind)), _OTHER)

    def _deviation(self, truth: np.ndarray, rotations: tuple[str, ...], away: np.ndarray) -> np.ndarray:
        """(F, K), degrees."""
        found = np.empty_like(truth)
        for column, name in enumerate(rotations):
            low, high = ACTIVE_RANGE_DEG.get(name, USUAL_RANGE_DEG)
            bent = np.clip((truth[:, column] - low) / (high - low), 0.0, 1.0)
            grown = 1.0 + (self.flexion_times - 1.0) * bent**FLEXION_POWER
            plain = self.stated_times * self._of_kind(name).stated_sd_deg
            found[:, column] = plain * grown * (1.0 + (self.away_times - 1.0) * away)
        return found

    @staticmethod
    def _away(at: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """(F,) 0 to 1: how far the hand is turned away, over some seconds."""
        wave = np.zeros(len(at))
        for _ in range(4):
            period, phase = random.uniform(4.0, 20.0), random.uniform(0.0, 2.0 * np.pi)
            wave += np.sin(2.0 * np.pi * at / period + phase)
        return 1.0 / (1.0 + np.exp(3.0 - 2.0 * wave))


CALIBRATED = SimulatedCamera(
    stated_times=0.7, spread=0.0, flexion_times=4.0, away_times=2.0, lasting_s=0.3, lean=0.5, stays=0.0,
    accepted_below_deg=2.5, over_stated=1.0,
)  # fmt: skip
"""Not the one that was measured: errors as large as stated, which grow with flexion."""
ON_OTHER_HANDS = SimulatedCamera(errors=ELSEWHERE, stays=0.46, lasting_s=1.0)
"""As on hands that another program draws."""


def lasting_noise(
    at: np.ndarray, columns: int, time_constant_s: float, random: np.random.Generator
) -> np.ndarray:
    """(F, columns): first-order noise of variance 1 at times ``at`` (F,), seconds."""
    found = random.standard_normal((len(at), columns))
    kept = np.exp(-np.diff(at) / time_constant_s)
    for row, share in enumerate(kept, start=1):
        found[row] = share * found[row - 1] + np.sqrt(1.0 - share**2) * found[row]
    return found


def towards_prior(truth: np.ndarray) -> np.ndarray:
    """(F, K), standardised: from each angle to what the other joints, as a linear prior, make of it."""
    spread = np.maximum(truth.std(axis=0), 1e-9)
    x = (truth - truth.mean(axis=0)) / spread
    found = np.empty_like(x)
    for column in range(x.shape[1]):
        others = np.delete(x, column, axis=1)
        gram = others.T @ others + 0.1 * len(x) * np.eye(others.shape[1])
        found[:, column] = others @ np.linalg.solve(gram, others.T @ x[:, column]) - x[:, column]
    return found / np.maximum(found.std(axis=0), 1e-9)
