"""Which step teaches most for its time, and when enough is known.

The process that one rotation is taken for, its variance after samples, and how much that falls with more.

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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.linalg import block_diag, cho_factor, cho_solve, solve_triangular

from glovecal_models.covariance.base import Covariance
from glovecal_models.covariance.functions import LinearArd, SquaredExponentialArd
from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_models.sampling.active.known_readings import (
    ALIKE_FRAMES,
    ExpectedReadings,
    KnownBlock,
    KnownReadings,
    shared_sd_deg,
)
from glovecal_models.sampling.limits import SAMPLING_LIMITS, SamplingLimits
from glovecal_models.sampling.protocol import Step, step_capture_s

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
USUAL_RATE_HZ = 60.0


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


@dataclass(frozen=True)
class ProposedStep:
    step: Step
    seconds: float
    """Capture time with countdown and settling."""
    sd_after_deg: Mapping[str, float]
    """Expected standard deviation of each rotation that it teaches something of."""
    rms_after_deg: float
    """Over all rotations."""
    error_fall_deg: float
    """By how much the expected error of a frame, noise included, falls."""

    @property
    def fall_per_s(self) -> float:
        return self.error_fall_deg / self.seconds


@dataclass(frozen=True)
class Proposal:
    ranked: tuple[ProposedStep, ...]
    """The one that teaches most for its time first."""
    sd_deg: Mapping[str, float]
    """Root mean variance of each rotation over free motion now, noise left out."""
    noise_deg: Mapping[str, float]
    learned: tuple[str, ...]
    """Rotations whose process comes from a trained model; the others' is assumed."""
    sentences: tuple[str, ...] = field(default=())
    limits: SamplingLimits = SAMPLING_LIMITS

    @property
    def rms_deg(self) -> float:
        return float(np.sqrt(np.mean(np.square(list(self.sd_deg.values())))))

    @property
    def is_enough(self) -> bool:
        return not self.ranked or max(each.error_fall_deg for each in self.ranked) < self.limits.enough_deg

    def to_document(self, most: int = 10) -> dict[str, Any]:
        return {
            "rms_sd_deg": _rounded(self.rms_deg),
            "sd_deg": {name: _rounded(deg) for name, deg in self.sd_deg.items()},
            "noise_deg": {name: _rounded(deg) for name, deg in self.noise_deg.items()},
            "enough": self.is_enough,
            "steps": [_step_document(each, self) for each in self.ranked[:most]],
            "assumed": [name for name in self.sd_deg if name not in self.learned],
            "sentences": [*self.sentences, self.verdict()],
        }

    def verdict(self) -> str:
        if not self.ranked:
            return "No pose or motion that could be asked for teaches any of this glove's rotations."
        best = self.ranked[0]
        if self.is_enough:
            return (
                f"Enough: the next step, {best.step.name}, would lower the expected error by less than "
                f"{self.limits.enough_deg:g} degrees. {self._left()}"
            )
        return f"Next: {best.step.name}. {gain_sentence(best, self)}"

    def _left(self) -> str:
        noise = float(np.sqrt(np.mean(np.square(list(self.noise_deg.values())))))
        if self.rms_deg <= noise:
            return f"What is left, {self.rms_deg:.1f} degrees, is below a frame's noise of {noise:.1f}."
        return (
            f"{self.rms_deg:.1f} degrees are left (a frame's noise: {noise:.1f}); more of these steps hardly "
            "lower them."
        )


def gain_sentence(best: ProposedStep, proposal: Proposal) -> str:
    """What is expected of a step, in degrees."""
    falls = sorted(best.sd_after_deg, key=lambda name: best.sd_after_deg[name] - proposal.sd_deg[name])[:4]
    told = ", ".join(f"{name} {proposal.sd_deg[name]:.1f} to {best.sd_after_deg[name]:.1f}" for name in falls)
    return (
        f"Expected standard deviation in degrees: {told}; over all rotations "
        f"{proposal.rms_deg:.2f} to {best.rms_after_deg:.2f}, in {best.seconds:.1f} s."
    )


def propose(
    layout: Layout,
    known: KnownReadings,
    candidates: Sequence[Step],
    *,
    trained: Mapping[str, ProcessRegressor] | None = None,
    limits: SamplingLimits = SAMPLING_LIMITS,
) -> Proposal:
    """Rank ``candidates`` by the expected fall of the error per second.

    ``trained`` has the processes by rotation that a current model holds. Raises BadInput where no candidate
    and no known reading says anything of any rotation.
    """
    informed = {rotation for step in candidates for rotation in step.angles}
    informed |= {rotation for block in known.blocks for rotation in block.angles}
    wanted = [item for item in layout.correspondences if item.simulated is None and item.rotation in informed]
    if not wanted:
        raise BadInput(f"layout {layout.name!r}: no pose or widget is known for any of its rotations")
    expected = ExpectedReadings(known, wanted)
    states = {item.rotation: _state(item, known, trained or {}) for item in wanted}
    now = {name: float(state.variance.mean()) for name, (_, state) in states.items()}
    noise = {name: process.noise_sd_deg for name, (process, _) in states.items()}
    ranked = []
    for step in candidates:
        after = dict(now)
        for item in wanted:
            if item.rotation in step.angles:
                fall = _fall(step, item, *states[item.rotation], expected)
                after[item.rotation] = max(now[item.rotation] - fall, 0.0)
        ranked.append(_proposed(step, now, after, noise))
    ranked.sort(key=lambda each: -each.fall_per_s)
    learned = tuple(name for name, (process, _) in states.items() if process.learned)
    return Proposal(tuple(ranked), _told_sd_deg(now), noise, learned, limits=limits)


def _state(
    item: Correspondence, known: KnownReadings, trained: Mapping[str, ProcessRegressor]
) -> tuple[AssumedProcess, PosteriorVariance]:
    process = assumed_process(item, known.low, known.high, known.sensors, trained.get(item.rotation))
    u = process.unit(item.input_columns(known.free, known.sensors))
    sampled = [sampled_points(block, item, process, known.sensors) for block in known.blocks]
    return process, PosteriorVariance(process, u, [each for each in sampled if len(each.points)])


def _fall(
    step: Step,
    item: Correspondence,
    process: AssumedProcess,
    state: PosteriorVariance,
    expected: ExpectedReadings,
) -> float:
    """Of the rotation's mean variance, degrees squared."""
    points = process.unit(expected.of(step, item))
    samples = step.seconds * USUAL_RATE_HZ / ALIKE_FRAMES
    errors = step_errors(len(points), samples, process.noise_sd_deg, shared_sd_deg(step))
    return float(state.fall(SampledPoints(points, errors)).mean())


def _proposed(
    step: Step, now: Mapping[str, float], after: Mapping[str, float], noise: Mapping[str, float]
) -> ProposedStep:
    frame = float(np.mean(np.square(list(noise.values()))))
    before_all, after_all = (float(np.mean(list(each.values()))) for each in (now, after))
    told = _told_sd_deg(after)
    return ProposedStep(
        step,
        step_capture_s(step),
        {name: told[name] for name in step.angles if name in told},
        float(np.sqrt(np.mean(np.square(list(told.values()))))),
        float(np.sqrt(before_all + frame) - np.sqrt(after_all + frame)),
    )


def _told_sd_deg(variance: Mapping[str, float]) -> dict[str, float]:
    """What is left to know of an angle that lies within its range anyway: precisions add."""
    told = {}
    for name, value in variance.items():
        in_range = rotation_range_deg(name) ** 2 / 12
        told[name] = float(np.sqrt(value * in_range / (value + in_range)))
    return told


def _step_document(each: ProposedStep, proposal: Proposal) -> dict[str, Any]:
    return {
        "name": each.step.name,
        "ask": each.step.ask,
        "needs": each.step.needs,
        "seconds": _rounded(each.seconds),
        "angles": dict(each.step.angles),
        "sd_deg": {name: _rounded(proposal.sd_deg[name]) for name in each.sd_after_deg},
        "sd_after_deg": {name: _rounded(deg) for name, deg in each.sd_after_deg.items()},
        "rms_sd_after_deg": _rounded(each.rms_after_deg),
        "error_fall_deg": float(f"{each.error_fall_deg:.3g}"),
        "sentence": gain_sentence(each, proposal),
    }


def _rounded(value: float) -> float:
    return round(value, 3)
