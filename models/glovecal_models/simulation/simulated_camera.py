"""A simulated camera as a reference: what it says of a hand whose angles are known.

No picture is made. What its errors are like was measured with the real tracker on rendered label images
(``python3 do.py study camera-errors``): hands of other bones and radii than the model's, labels spoilt as a
classifier spoils them, two cameras 60 degrees apart, stage dense, 16 hands for 10 s each. The errors last for
about a second, are a third larger than stated, lean to the mean of a prior that predicts each joint from the
others, and have a part that stays as long as the hand does. With one camera the stated deviations are 1.2 to
2.4 times as large, and what stays is a third of the deviation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG
from glovecal_models.takes.camera_reference.estimates import CameraEstimates

USUAL_RANGE_DEG = (-10.0, 90.0)
STATED_SD_DEG = {"MCP": 4.1, "PIP": 5.1, "DIP": 7.2, "IP": 4.2, "TMC": 1.3, "ABD": 2.1, "VIR": 3.4}
"""Median over frames, by the kind of joint; with one camera 4.8, 8.0, 8.2, 4.6, 3.1, 4.0, 4.2."""
LEAN = {"MCP": 0.1, "PIP": 0.3, "DIP": 0.65, "IP": 0.7, "TMC": 0.1, "ABD": 0.4, "VIR": 0.35}
"""Of the true deviation, along the way to the prior's mean: regression of errors on it."""
FLEXION_POWER, SPREAD_S = 2.5, 1.5
"""How steeply a deviation grows along the active range, if it does; how long one above the usual lasts."""
_OTHER_SD_DEG, _OTHER_LEAN = 4.0, 0.36
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
    lasting_s: float = 0.9
    """Time within which errors count as one sample: twice the time constant of their correlation."""
    lean: float | None = None
    """Part of the deviation that leans to the prior's mean; None: as measured, by the kind of joint."""
    stays: float = 0.5
    """Part of the deviation that is the same as long as the hand is; the rest is chance."""
    hand: int = 0
    """Whose hand it is: decides what stays."""
    accepted_below_deg: float = 4.5
    overconfident: float = 1.35
    """True deviation over the stated one, of accepted angles; 1: calibrated."""
    dropped: float = 0.01
    """Share of frames that are lost."""

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
        lean = np.array([_by_kind(name, LEAN, _OTHER_LEAN) for name in rotations])
        if self.lean is not None:
            lean = np.full(len(rotations), self.lean)
        staying = np.random.default_rng([self.hand, 72]).standard_normal(len(rotations))
        left = np.sqrt(np.maximum(0.0, 1.0 - lean**2 - self.stays**2))
        error = left * chance + lean * towards_prior(truth) + self.stays * staying
        patches = np.round(14.0 - 6.0 * away + 0.7 * random.standard_normal(len(at))).clip(3, 20)
        return CameraEstimates(
            time_s=at + self.offset_s,
            rotations=rotations,
            angles_deg=truth + self.overconfident * sd * error,
            sd_deg=sd,
            accepted=sd < self.accepted_below_deg,
            patches=patches.astype(int),
            simulated=True,
        )

    def _deviation(self, truth: np.ndarray, rotations: tuple[str, ...], away: np.ndarray) -> np.ndarray:
        """(F, K), degrees."""
        found = np.empty_like(truth)
        for column, name in enumerate(rotations):
            low, high = ACTIVE_RANGE_DEG.get(name, USUAL_RANGE_DEG)
            bent = np.clip((truth[:, column] - low) / (high - low), 0.0, 1.0)
            grown = 1.0 + (self.flexion_times - 1.0) * bent**FLEXION_POWER
            plain = self.stated_times * _by_kind(name, STATED_SD_DEG, _OTHER_SD_DEG)
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
    stated_times=0.35, spread=0.0, flexion_times=4.0, away_times=2.0, lasting_s=0.3, lean=0.5, stays=0.0,
    accepted_below_deg=2.5, overconfident=1.0,
)  # fmt: skip
"""A better camera than was measured: errors as large as stated, which grow with flexion."""


def _by_kind(name: str, values: Mapping[str, float], other: float) -> float:
    return next((value for kind, value in values.items() if name.endswith(kind)), other)


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
