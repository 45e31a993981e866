"""A simulated camera as a reference: what it says of a hand whose angles are known.

No picture is made. Errors have the form that was measured on rendered pictures of the colour glove
(Wang & Popovic 2009): they last for some tenths of a second, grow with flexion (distal joints most) and while
the hand is turned away, and lean to the mean of the prior, which predicts each joint from the others. Stated
deviations are those of the errors; an estimate is accepted below a limit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG
from glovecal_models.takes.camera_reference.estimates import CameraEstimates

USUAL_RANGE_DEG = (-10.0, 90.0)
SCALE = {"MCP": 1.0, "PIP": 1.6, "DIP": 2.2, "IP": 1.6, "TMC": 1.8, "ABD": 1.3}
"""Of the deviation, by the kind of joint: RMS on rendered pictures 2.2 to 2.7 at MCP, 6 to 11 at PIP, 8 to 14
at DIP, 3 to 5 in abduction and 2 to 5 at the thumb, accepted or not."""


@dataclass(frozen=True)
class SimulatedCamera:
    """What decides over its errors; degrees, seconds."""

    rate_hz: float = 30.0
    offset_s: float = 0.08
    """Camera time less glove time."""
    least_sd_deg: float = 1.2
    """Of a straight finger in plain view at an MCP joint."""
    flexion_power: float = 2.5
    """How steeply the deviation grows along the active range."""
    flexion_times: float = 4.0
    """The deviation at full flexion, in those of the straight joint."""
    away_times: float = 2.0
    """The deviation while the hand is turned away, in those of plain view."""
    lasting_s: float = 0.3
    """Time within which errors count as one sample: twice the time constant of their correlation."""
    lean: float = 0.5
    """Part of the deviation that leans to the prior's mean; the rest is chance."""
    accepted_below_deg: float = 2.5
    overconfident: float = 1.0
    """True deviation over the stated one; 1: calibrated."""
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
        chance = lasting_noise(at, sd.shape[1], self.lasting_s / 2.0, random)
        lean = _towards_prior(truth)
        error = np.sqrt(1.0 - self.lean**2) * chance + self.lean * lean
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
            scale = next((value for kind, value in SCALE.items() if name.endswith(kind)), 1.3)
            grown = 1.0 + (self.flexion_times - 1.0) * bent**self.flexion_power
            found[:, column] = self.least_sd_deg * scale * grown * (1.0 + (self.away_times - 1.0) * away)
        return found

    @staticmethod
    def _away(at: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """(F,) 0 to 1: how far the hand is turned away, over some seconds."""
        wave = np.zeros(len(at))
        for _ in range(4):
            period, phase = random.uniform(4.0, 20.0), random.uniform(0.0, 2.0 * np.pi)
            wave += np.sin(2.0 * np.pi * at / period + phase)
        return 1.0 / (1.0 + np.exp(3.0 - 2.0 * wave))


def lasting_noise(
    at: np.ndarray, columns: int, time_constant_s: float, random: np.random.Generator
) -> np.ndarray:
    """(F, columns): first-order noise of variance 1 at times ``at`` (F,), seconds."""
    found = random.standard_normal((len(at), columns))
    kept = np.exp(-np.diff(at) / time_constant_s)
    for row, share in enumerate(kept, start=1):
        found[row] = share * found[row - 1] + np.sqrt(1.0 - share**2) * found[row]
    return found


def _towards_prior(truth: np.ndarray) -> np.ndarray:
    """(F, K), standardised: from each angle to what the other joints, as a linear prior, make of it."""
    spread = np.maximum(truth.std(axis=0), 1e-9)
    x = (truth - truth.mean(axis=0)) / spread
    found = np.empty_like(x)
    for column in range(x.shape[1]):
        others = np.delete(x, column, axis=1)
        gram = others.T @ others + 0.1 * len(x) * np.eye(others.shape[1])
        found[:, column] = others @ np.linalg.solve(gram, others.T @ x[:, column]) - x[:, column]
    return found / np.maximum(found.std(axis=0), 1e-9)
