"""The process that one rotation is taken for, its variance after samples, and how much that falls with more.

Units are those that every glove shares: ranges and degrees. The paper's covariance k_LARD + k_seARD (Wang &
Neff 2013, equation 8) has a level and slopes that are not known beforehand. In the beginning there is nothing
to learn the hyperparameters from, so they are assumed: those of simulated CyberGloves with dense reference,
widened, because a trained process' own may be rougher.

With samples at X, whose errors have the covariance N, the variance at u is

    v(u) = k(u, u) - k(u, X) (K + N)^-1 k(X, u)

and further samples at C, of error covariance M, lower it by g (S + M)^-1 g', where g and S are the
covariances (after X) of u with C and of C with itself (Rasmussen & Williams 2006, equation 2.24; the mean of
the fall over many u is the criterion of Cohn 1996). No target is needed for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import block_diag, cho_factor, cho_solve, solve_triangular

from glovecal_models.covariance.base import Covariance
from glovecal_models.covariance.linear_ard import LinearArd
from glovecal_models.covariance.squared_exponential import SquaredExponentialArd
from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG
from glovecal_models.layout import Correspondence
from glovecal_models.regression.process_regressor import ProcessRegressor
from glovecal_models.sampling.active.known_readings import KnownBlock

USUAL_RANGE_DEG = 90.0
LEVEL, SLOPE = 1.0, 2.0
"""Standard deviations of the level in rotation ranges, of slopes in these per range of a sensor."""
BEND_ALONE, BEND_COUPLED = 0.06, 0.15
"""How far from straight, as a share of the rotation's range: read from one sensor, or from several."""
LEAST_BEND_DEG = 6.0
"""Of a coupled rotation; an abduction's own range is small beside what its neighbours do to it."""
OWN_LENGTH, OTHER_LENGTH = 0.35, 0.7
"""Lengthscales of that bend, in ranges of the sensor."""
TYPICAL: dict[str, tuple[float, float, float]] = {
    **dict.fromkeys(("IM_ABD", "MR_ABD", "RP_ABD"), (80.0, 0.8, 0.9)),
    "TI_ABD": (10.0, 0.6, 0.7),
    "W_FLEX": (20.0, 0.3, 0.25),
    "W_ABD": (8.0, 0.3, 0.25),
}
"""Bend in degrees, its lengthscales along the own sensor and the others: coupled sensors of CyberGloves."""
NOISE_SD_DEG = 1.3
"""Of a frame: a CyberGlove's reading noise (Kessler et al. 1995: 1.1) and steps of 8 bits."""
LEAST_NOISE_DEG = 0.5
"""A trained process that claims less has followed single frames: its hyperparameters are not taken over."""
_NONE = -60.0
"""Logarithm of a relevance that is none."""


@dataclass(frozen=True)
class AssumedProcess:
    """What is taken for known of one rotation's map before its samples; D inputs."""

    correspondence: Correspondence
    middle: np.ndarray
    """Of each input's active range, shape (D,), counts."""
    span: np.ndarray
    """Width of each input's active range, shape (D,), counts."""
    theta: np.ndarray
    """Of ``covariance`` over [inputs in ranges, 1], degrees."""
    noise_sd_deg: float
    learned: bool
    """Whether bend, lengthscales and noise come from a trained model."""

    @property
    def covariance(self) -> Covariance:
        return LinearArd() + SquaredExponentialArd()

    def unit(self, inputs: np.ndarray) -> np.ndarray:
        """Inputs (N, D), counts, in ranges from the middle, and a column of ones: (N, D + 1)."""
        return np.column_stack([(inputs - self.middle) / self.span, np.ones(len(inputs))])

    def between(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Covariance of the rotation at ``a`` (A, D + 1) and ``b`` (B, D + 1), degrees squared."""
        return self.covariance(self.theta, a, b)

    def alone(self, a: np.ndarray) -> np.ndarray:
        """Its variance at ``a``, shape (A,), when nothing was sampled."""
        return self.covariance.diagonal(self.theta, a)


def assumed_process(
    correspondence: Correspondence,
    low: np.ndarray,
    high: np.ndarray,
    sensors: Sequence[str],
    trained: ProcessRegressor | None = None,
) -> AssumedProcess:
    """For a rotation whose sensors went from ``low`` to ``high`` (S,), counts.

    ``trained`` gives bend, lengthscales and noise where they can be believed.
    """
    ends = correspondence.input_columns(np.array([low, high], float), sensors)
    span = np.maximum(np.abs(ends[1] - ends[0]), 1e-9)
    range_deg = rotation_range_deg(correspondence.rotation)
    learned = trained is not None and np.sqrt(trained.noise_variance) >= LEAST_NOISE_DEG
    if trained is not None and learned:
        bend, relevance = float(trained.theta[-len(span) - 1]), trained.theta[-len(span) :]
        relevance = relevance + 2 * np.log(span / trained.input_scale)
        noise_deg = float(np.sqrt(trained.noise_variance))
    else:
        bend, relevance = _usual_bend(correspondence, range_deg)
        noise_deg = NOISE_SD_DEG
    line = 2 * np.log(range_deg * np.array([*[SLOPE] * len(span), LEVEL]))
    theta = np.concatenate([line, [bend], relevance, [_NONE]])
    return AssumedProcess(correspondence, ends.mean(axis=0), span, theta, noise_deg, bool(learned))


def rotation_range_deg(rotation: str) -> float:
    """How far it goes, of a usual hand."""
    return float(np.ptp(ACTIVE_RANGE_DEG.get(rotation, (0.0, USUAL_RANGE_DEG))))


def _usual_bend(correspondence: Correspondence, range_deg: float) -> tuple[float, np.ndarray]:
    """Logarithms of the bend's variance and of each input's relevance."""
    bend = max(BEND_COUPLED * range_deg, LEAST_BEND_DEG)
    if len(correspondence.inputs) == 1:
        bend = BEND_ALONE * range_deg
    bend, own, other = TYPICAL.get(correspondence.rotation, (bend, OWN_LENGTH, OTHER_LENGTH))
    lengths = np.full(len(correspondence.inputs), other)
    measuring = correspondence.measuring_sensor
    lengths[correspondence.inputs.index(measuring) if measuring else 0] = own
    return 2 * float(np.log(bend)), -2 * np.log(lengths)


@dataclass(frozen=True)
class SampledPoints:
    """Of one step."""

    points: np.ndarray
    """Inputs in the process' units, shape (m, D + 1)."""
    errors: np.ndarray
    """Covariance of the errors, shape (m, m), degrees squared."""
    target: np.ndarray = field(default_factory=lambda: np.empty(0))
    """Degrees, shape (m,); empty for a step that was not recorded yet."""


def step_errors(rows: int, samples: float, noise_sd_deg: float, shared_sd_deg: float) -> np.ndarray:
    """Error covariance (m, m) of ``rows`` that stand for ``samples`` and have one error in common."""
    own = noise_sd_deg**2 * rows / max(samples, 1.0)
    return own * np.eye(rows) + shared_sd_deg**2


def sampled_points(
    block: KnownBlock, item: Correspondence, process: AssumedProcess, sensors: tuple[str, ...]
) -> SampledPoints:
    """What ``block`` knows of the rotation; no points where it was not measured."""
    angle = block.angles.get(item.rotation, np.full(len(block.readings), np.nan))
    rows = np.isfinite(angle)
    points = process.unit(item.input_columns(block.readings[rows], sensors))
    samples = block.samples * rows.mean()
    errors = step_errors(len(points), samples, process.noise_sd_deg, block.shared_sd_deg)
    return SampledPoints(points, errors, angle[rows])


class PosteriorVariance:
    """Of one rotation, at the points ``u`` (U, D + 1) where it will be used."""

    def __init__(self, process: AssumedProcess, u: np.ndarray, sampled: Sequence[SampledPoints]) -> None:
        self._process, self._u = process, u
        self._points = np.concatenate([np.empty((0, u.shape[1])), *(each.points for each in sampled)])
        self._lower = self._root([each.errors for each in sampled])
        self._white = self._whitened(u)
        self.variance = np.maximum(process.alone(u) - (self._white**2).sum(axis=0), 0.0)
        """At u, shape (U,), degrees squared, without the noise of a frame."""

    def fall(self, more: SampledPoints) -> np.ndarray:
        """By how much the variance at u falls, shape (U,), with ``more`` samples."""
        white = self._whitened(more.points)
        between = self._process.between(self._u, more.points) - self._white.T @ white
        inside = self._process.between(more.points, more.points) - white.T @ white + more.errors
        return np.einsum("um,mu->u", between, cho_solve(cho_factor(inside, lower=True), between.T))

    def _root(self, errors: Sequence[np.ndarray]) -> np.ndarray:
        """Lower root of K + N."""
        if not len(self._points):
            return np.empty((0, 0))
        matrix = self._process.between(self._points, self._points) + block_diag(*errors)
        return np.linalg.cholesky(matrix)

    def _whitened(self, points: np.ndarray) -> np.ndarray:
        if not len(self._points):
            return np.empty((0, len(points)))
        to_points = self._process.between(self._points, points)
        return solve_triangular(self._lower, to_points, lower=True, check_finite=False)
