"""Garment slip: the cloth creeps over the skin, and the error wanders slowly, inside takes and between them.

Inside a take the error of a calibrated model is averaged over 10 s. Frame noise and everything that is
stationary within 10 s (misfit that comes and goes with the posture) give such means a variance that can be
worked out from the 10 s themselves; a slip gives far more, and its means follow one another. A slower slip
shows in how the takes of one wearing differ (take_spread.py). Every glove slips by a few tenths of a degree;
that is not named.

A model that has it claims a standard deviation that grows from the start of a run or wearing. Where the glove
sits is not estimated anew from the readings: on four simulated gloves that slip by 2 degrees, the postures of
a whole 40 s take told the offset to 1.5 degrees at best, and only for a hand that moves as in training.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from glovecal_models.effects.effect import Settings
from glovecal_models.effects.interval_effect import IntervalEffect, LeftOutErrors
from glovecal_models.effects.signature_effect import Finding, check_signature_input
from glovecal_models.effects.slip_growth import GROWS_S, SlipGrowth, SlipInterval, slip_growth
from glovecal_models.effects.take_spread import TakeSpread, is_common, spread_of_takes
from glovecal_models.takes.take import Take

MEAN_S = 10.0
SHORT_S = 1.0
LEAST_MEANS = 3
"""Of a take, for it to count; over all takes twice as many."""
EVERY_GLOVE_DEG = 0.6
"""Slow wandering of a healthy glove stays below this."""
OVER_NOISE = 1.0
"""The slip must exceed the frame noise so many times."""
OVER_STATIONARY = 3.0
"""Variance of the 10 s means over what stationary errors would give."""
FOLLOWS = 1.5
"""Von Neumann's ratio: 2 for means in no order, below 1 for a random walk."""
CERTAINTY = 0.01
POSTURE_DEGREE = 3


@dataclass(frozen=True)
class Slip:
    """How the error of one rotation wanders."""

    size_deg: float
    """Standard deviation of the wandering inside a take."""
    least_deg: float
    """Its lower bound, one-sided 99 %."""
    rate_deg_per_sqrt_min: float
    frame_noise_deg: float
    over_stationary: float
    follows: float
    means: int

    @property
    def is_slip(self) -> bool:
        return (
            self.least_deg > max(EVERY_GLOVE_DEG, OVER_NOISE * self.frame_noise_deg)
            and self.over_stationary > OVER_STATIONARY
            and self.follows < FOLLOWS
        )


class GarmentSlip(IntervalEffect):
    name = "garment_slip"
    explanation = "The glove slips on the hand while it is worn: the error wanders and does not come back."
    source = "random walk of the offset, deg/sqrt(min); a known pose resets it"

    def find(
        self,
        takes: Sequence[Take],
        sensor_of: Mapping[str, str],
        errors: Sequence[np.ndarray] | None = None,
    ) -> tuple[Finding, ...]:
        check_signature_input(takes, sensor_of, errors)
        if errors is None:
            return ()
        found, between = [], []
        for column, rotation in enumerate(sensor_of):
            own = [error[:, column] for error in errors]
            slip = slip_of(takes, own, rotation)
            if slip is not None and slip.is_slip:
                found.append(_finding(rotation, slip))
                continue
            plain = _without_posture(takes, own, rotation)
            spread = spread_of_takes(takes, plain)
            if spread is None or not spread.is_slip:
                continue
            if spread.size_deg > OVER_NOISE * _frame_noise(plain, takes):
                between.append((_finding_between(rotation, spread), plain))
        if not is_common(takes, [plain for _, plain in between]):
            found += [finding for finding, _ in between]
        return tuple(sorted(found, key=lambda item: -(item.size_deg or 0.0)))

    @property
    def needs_time(self) -> bool:
        return True

    def learned(self, left_out: Sequence[LeftOutErrors], found: Settings) -> Settings:
        rotations = dict.fromkeys(item.rotation for item in left_out)
        growths = {
            name: slip_growth([item for item in left_out if item.rotation == name]) for name in rotations
        }
        fresh = {name: growth.to_settings() for name, growth in growths.items()}
        return {"rotations": dict(found.get("rotations", {})) | fresh}

    def interval(
        self, settings: Settings, rotations: Sequence[str], sensors: Sequence[str], noise: np.ndarray
    ) -> SlipInterval:
        return SlipInterval([SlipGrowth(**settings["rotations"][name]) for name in rotations], noise)

    def sentence(self, settings: Settings, rotations: Sequence[str]) -> str:
        rates = [settings["rotations"][name]["rate_deg_per_sqrt_min"] for name in rotations]
        return (
            f"where the glove sits is not known, and less so with every minute: the claimed standard deviation "
            f"grows by {max(rates):.1f} degrees in the first minute, until a new wearing or run starts"
        )

    def described_on(self, settings: Settings, rotation: str) -> dict[str, float]:
        growth = SlipGrowth(**settings["rotations"][rotation])
        return {
            "rate_deg_per_sqrt_min": growth.rate_deg_per_sqrt_min,
            "start_share_of_noise_1": growth.start_share,
            "grows_s": GROWS_S,
        }


def slip_of(takes: Sequence[Take], errors: Sequence[np.ndarray], rotation: str) -> Slip | None:
    """How the errors (N,) of each take wander; None when the takes are too short to say."""
    errors = _without_posture(takes, errors, rotation)
    groups = [_short_means(take.time_s, error) for take, error in zip(takes, errors, strict=True)]
    groups = [group for group in groups if len(group) >= LEAST_MEANS]
    if sum(map(len, groups)) < 2 * LEAST_MEANS:
        return None
    long = [group.mean(axis=1) for group in groups]
    free = sum(len(means) - 1 for means in long)
    squares = sum(float(np.sum((means - means.mean()) ** 2)) for means in long)
    successive = sum(float(np.sum(np.diff(means) ** 2)) for means in long)
    expected = _stationary_variance(np.concatenate(groups))
    variance = squares / free
    excess = max(variance - expected, 0.0)
    # The means of a walk hold one another: about half of them count as independent.
    independent = max(free / 2.0, 1.0)
    least = max(variance * independent / float(chi2.ppf(1.0 - CERTAINTY, independent)) - expected, 0.0)
    # A walk of rate q gives J means of length T a variance of q² T (J + 1) / 6.
    walked = sum(MEAN_S * (len(means) + 1) / 6.0 * (len(means) - 1) for means in long) / free
    return Slip(
        float(np.sqrt(excess)), float(np.sqrt(least)), float(np.sqrt(60.0 * excess / walked)),
        _frame_noise(errors, takes), variance / max(expected, 1e-12), successive / max(squares, 1e-12),
        sum(map(len, long)),
    )  # fmt: skip


def _without_posture(takes: Sequence[Take], errors: Sequence[np.ndarray], rotation: str) -> list[np.ndarray]:
    """Errors less a smooth function of the joint's own angle: a curve that is missing is not a slip."""
    angles = [take.reference_at_frames([rotation])[:, 0] for take in takes]
    every = np.concatenate(angles)
    known = np.isfinite(every) & np.isfinite(np.concatenate(errors))
    if known.sum() < 100 or every[known].std() < 1.0:
        return list(errors)
    centre, scale = every[known].mean(), 2.0 * every[known].std()

    def powers(angle: np.ndarray) -> np.ndarray:
        return np.vander((angle - centre) / scale, POSTURE_DEGREE + 1)

    weights = np.linalg.lstsq(powers(every[known]), np.concatenate(errors)[known], rcond=None)[0]
    return [error - powers(angle) @ weights for error, angle in zip(errors, angles, strict=True)]


def _short_means(time_s: np.ndarray, error: np.ndarray) -> np.ndarray:
    """(J, 10) means over 1 s, a row for each complete 10 s; (0, 10) when there are none."""
    per = round(MEAN_S / SHORT_S)
    known = np.isfinite(error)
    if not known.any():
        return np.empty((0, per))
    second = ((time_s - time_s[0]) / SHORT_S).astype(int)
    count = np.bincount(second, known)
    total = np.bincount(second, np.where(known, error, 0.0))
    means = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    rows = means[: len(means) // per * per].reshape(-1, per)
    return rows[np.isfinite(rows).all(axis=1)]


def _stationary_variance(rows: np.ndarray) -> float:
    """Variance of the mean of a row, were the rows (J, T) pieces of an autoregressive noise of order one."""
    inside = rows - rows.mean(axis=1, keepdims=True)
    length = rows.shape[1]
    variance = float(np.sum(inside**2)) / (len(rows) * (length - 1))
    correlation = float(np.sum(inside[:, 1:] * inside[:, :-1]) / max(float(np.sum(inside**2)), 1e-300))
    # Taking the mean of so short a row away makes it look less correlated than it is.
    correlation = float(np.clip(correlation + (1.0 + 3.0 * correlation) / length, 0.0, 0.8))
    return variance / length * (1.0 + correlation) / (1.0 - correlation)


def _frame_noise(errors: Sequence[np.ndarray], takes: Sequence[Take]) -> float:
    """RMS, degrees, of what is quicker than a second."""
    total, count = 0.0, 0
    for take, error in zip(takes, errors, strict=True):
        known = np.isfinite(error)
        second = ((take.time_s - take.time_s[0]) / SHORT_S).astype(int)[known]
        if len(second):
            frames = np.maximum(np.bincount(second), 1)
            left = error[known] - (np.bincount(second, error[known]) / frames)[second]
            total, count = total + float(np.sum(left**2)), count + len(left)
    return float(np.sqrt(total / max(count, 1)))


def _finding(rotation: str, slip: Slip) -> Finding:
    rate = slip.rate_deg_per_sqrt_min
    sentence = (
        f"{rotation}: the error wanders by {slip.size_deg:.1f} deg inside takes, {rate:.1f} deg in a minute "
        "and growing with the square root of time; hold a known pose now and then."
    )
    evidence = {
        "rate_deg_per_sqrt_min": rate,
        "least_size_deg": slip.least_deg,
        "frame_noise_deg": slip.frame_noise_deg,
        "variance_over_stationary_1": slip.over_stationary,
        "von_neumann_ratio_1": slip.follows,
    }
    return Finding(
        GarmentSlip.name, (rotation,), sentence, size_deg=slip.size_deg, count=slip.means, evidence=evidence
    )


def _finding_between(rotation: str, spread: TakeSpread) -> Finding:
    sentence = (
        f"{rotation}: the mean error of takes inside one wearing differs by {spread.size_deg:.1f} deg, "
        f"on a healthy glove by {spread.healthy_deg:.1f} deg; start every take with a known pose."
    )
    evidence = {
        "least_size_deg": spread.least_deg,
        "healthy_size_deg": spread.healthy_deg,
        "variance_over_wander_1": spread.over_wander,
    }
    return Finding(
        GarmentSlip.name, (rotation,), sentence, kind="between takes", size_deg=spread.size_deg,
        count=spread.takes, evidence=evidence,
    )  # fmt: skip
