"""The weight of each sample in training a Gaussian process, chosen by the held-out error.

The marginal likelihood assumes independent errors. Those of frames are autocorrelated: on ankle sleeves
walking at 200 Hz over tens of frames. A process trained as if they were independent follows single strides
(lengthscales of a fifth of the readings' spread) and can lose to a straight line on the next walk. A
weighted (composite) likelihood corrects that (Pauli, Racugno & Ventura 2011). Training errors do not show
the best weight, as the process is already fitted to them, so a few weights are compared on held-out takes,
and only where the process has many degrees of freedom for the effective sample size. They are compared by
rough processes, whose held-out error is within 1 to 4 % of that of thoroughly trained ones; only the chosen
one is trained thoroughly.

Effective sample ratio: N samples are worth N / (1 + 2 sum_k rho_k) independent ones, rho_k the correlation of
errors k frames apart (the integrated autocorrelation time; Kish's design effect in surveys).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from glovecal_models.calibration.folds import folds_over_takes
from glovecal_models.errors import NotTrainable
from glovecal_models.progress import Cancel, Report, part
from glovecal_models.regression.fast_lmc import finish_search, fit_lmc_gpr
from glovecal_models.regression.lmc_search import LmcOptimum, LmcSearch, fit_roughly
from glovecal_models.regression.process_regressor import ProcessRegressor
from glovecal_models.regression.sample_noise import with_stated_variance
from glovecal_models.regression.training_samples import check_samples

WEIGHTS = (0.4, 0.2, 0.08, 0.03)
"""Tried in turn until the error on left-out takes rises; the last leaves little more than a plane. Where the
first is the best, it is held against 1, the dearest and the least likely where there is need."""
LEAST_WORTH = 10
"""Whole samples per coefficient of the plane that all samples together must count for."""
CROWDED = 0.5
"""Degrees of freedom of the process per independent sample, from which it may be following single ones."""
FOLDS = 3
FADED = 0.05
"""Correlation at which errors are taken for independent: what follows is scatter of the estimate."""
LEAST_PAIRS = 30
WIDENING = 0.3
"""Lags are looked at together in ranges this part of their start: 1, 2, 3, 4, 5, 6-7, 8-10 ... frames."""


@dataclass(frozen=True)
class Recorded:
    """Samples with the place each was recorded at; N of them."""

    inputs: np.ndarray
    """Shape (N, D), raw counts."""
    target: np.ndarray
    """Shape (N,), degrees."""
    take: np.ndarray
    """Index of the take, shape (N,)."""
    position: np.ndarray
    """Number of the frame, counted through all takes, shape (N,), increasing."""
    variance: np.ndarray | None = None
    """Stated variance of each target, shape (N,), degrees squared; None: all alike."""


@dataclass(frozen=True)
class Weighted:
    """A process, what each sample counted in its training, and why."""

    regressor: ProcessRegressor
    weight: float
    evidence: dict[str, Any] = field(default_factory=dict)


def fit_weighted(
    samples: Recorded,
    *,
    known: LmcOptimum | None = None,
    seed: int = 0,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> Weighted:
    """As ``_fit_alike``; where variances are stated the process is trained anew with these, from there."""
    found = _fit_alike(samples, known=known, seed=seed, cancelled=cancelled, report=report)
    if samples.variance is None:
        return found
    process = with_stated_variance(
        found.regressor, samples.inputs, samples.target, samples.variance, seed=seed, cancelled=cancelled
    )
    return replace(found, regressor=replace(process, evidence=found.regressor.evidence | process.evidence))


def _fit_alike(
    samples: Recorded,
    *,
    known: LmcOptimum | None = None,
    seed: int = 0,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> Weighted:
    """The LMC-GPR of ``samples``, each counting what serves takes left out best.

    ``known``: of a training of more samples of the same takes: their weight is kept, the search begins there.

    The regressor's evidence tells ``effective_sample_ratio``, ``degrees_of_freedom`` and, where weights were
    tried, ``held_out_rmse_deg`` of each. Raises NotTrainable, Cancelled.
    """
    say = report or (lambda sentence, share: None)
    if known is not None:
        say("searching from a known optimum", 0.0)
        begun = LmcSearch.begin(
            samples.inputs, samples.target, sample_weight=known.sample_weight, start=known.parameters,
            seed=seed, cancelled=cancelled,
        )  # fmt: skip
        return Weighted(finish_search(begun, cancelled=cancelled), known.sample_weight)
    say("searching from several starts", 0.0)
    search = LmcSearch.begin(samples.inputs, samples.target, seed=seed, cancelled=cancelled)
    whole, need = None, None
    if search.is_expensive:  # a rough process may show the need for a tenth of the cost
        rough = fit_roughly(
            samples.inputs, samples.target, start=search.found[0].parameters, seed=seed, cancelled=cancelled
        )
        need = _Need.of(samples, rough.mean(samples.inputs), rough.degrees_of_freedom())
    if need is None or not need.is_there:
        whole = finish_search(search, cancelled=cancelled, report=part(report, 0.1, 0.5))
        fitted = whole.predict(samples.inputs)
        freedom = np.minimum(fitted.variance / max(whole.noise_variance, 1e-12), 1.0).sum()
        need = _Need.of(samples, fitted.mean, float(freedom))
    evidence: dict[str, Any] = {"effective_sample_ratio": need.share, "degrees_of_freedom": need.freedom}
    best = 1.0
    if need.is_there:
        trial = _Trial(samples, search, seed, cancelled, part(report, 0.5, 0.8))
        errors = trial.held_out_errors()
        evidence["held_out_rmse_deg"] = {f"{weight:g}": errors[weight] for weight in sorted(errors)[::-1]}
        best = min(errors, key=lambda weight: (errors[weight], weight), default=1.0)
        search = trial.search(best)
    if whole is None or best < 1.0:
        say(f"training with samples weighted {best:g}", 0.8)
        whole = finish_search(search, cancelled=cancelled)
    return Weighted(replace(whole, evidence=whole.evidence | evidence), best, evidence)


@dataclass(frozen=True)
class _Need:
    """Whether weights have to be tried, and why."""

    share: float
    """How much of an independent sample each sample is."""
    freedom: float
    """Degrees of freedom that the process uses."""
    is_there: bool

    @classmethod
    def of(cls, samples: Recorded, fitted: np.ndarray, freedom: float) -> _Need:
        share = effective_sample_ratio(samples.target - fitted, samples.take, samples.position)
        return cls(share, freedom, freedom > CROWDED * share * len(samples.target))


class _Trial:
    """Weights compared by the errors of processes that have not seen some of the takes."""

    def __init__(
        self, samples: Recorded, whole: LmcSearch, seed: int, cancelled: Cancel | None, report: Report | None
    ) -> None:
        """``whole``: the search on all samples at weight 1."""
        self._samples, self._seed, self._cancelled, self._report = samples, seed, cancelled, report
        self._searches = {1.0: whole}
        folds = [fold.held_out for fold in folds_over_takes(samples.take, FOLDS)]
        self._folds = [held_out for held_out in folds if _can_be_left_out(samples, held_out)]
        least = LEAST_WORTH * (samples.inputs.shape[1] + 1) / len(samples.target)
        self._weights = [weight for weight in WEIGHTS if weight >= least]
        self._fits = 0

    def held_out_errors(self) -> dict[float, float]:
        """RMSE in degrees by weight; empty where too little is left to train on when takes are left out."""
        errors: dict[float, float] = {}
        for weight in self._weights if self._folds else ():
            errors[weight] = _rmse(self._rough_errors(weight))
            if errors[weight] > min(errors.values()):
                break
        if errors and errors[self._weights[0]] == min(errors.values()):
            errors[1.0] = self._error_at_one(errors[self._weights[0]])
        return errors

    def _error_at_one(self, rival: float) -> float:
        """Lengthscales of some samples flatter weight 1: those of all have to beat ``rival``."""
        squared = self._rough_errors(1.0)
        for fold, held_out in enumerate(self._folds):
            if _rmse(squared) >= rival:
                break
            inputs, target = self._without(held_out)
            process = fit_lmc_gpr(inputs, target, seed=self._seed, cancelled=self._cancelled)
            squared[fold] = self._squared(held_out, process.predict(self._samples.inputs[held_out]).mean)
        return _rmse(squared)

    def search(self, weight: float) -> LmcSearch:
        """On all samples, each counting ``weight``."""
        if weight not in self._searches:
            self._searches[weight] = LmcSearch.begin(
                self._samples.inputs, self._samples.target,
                sample_weight=weight, seed=self._seed, cancelled=self._cancelled,
            )  # fmt: skip
        return self._searches[weight]

    def _rough_errors(self, weight: float) -> list[np.ndarray]:
        """Squared errors on each fold."""
        squared = []
        for held_out in self._folds:
            if self._report:
                most = (len(self._weights) + 1) * len(self._folds)
                done = f"{self._fits + 1} of at most {most}"
                self._report(f"choosing sample weights: {done}", self._fits / most)
            process = fit_roughly(
                *self._without(held_out), sample_weight=weight,
                start=self.search(weight).found[0].parameters, seed=self._seed, cancelled=self._cancelled,
            )  # fmt: skip
            squared.append(self._squared(held_out, process.mean(self._samples.inputs[held_out])))
            self._fits += 1
        return squared

    def _squared(self, held_out: np.ndarray, mean: np.ndarray) -> np.ndarray:
        return (mean - self._samples.target[held_out]) ** 2

    def _without(self, held_out: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self._samples.inputs[~held_out], self._samples.target[~held_out]


def _rmse(squared: list[np.ndarray]) -> float:
    return float(np.sqrt(np.concatenate(squared).mean()))


def _can_be_left_out(samples: Recorded, held_out: np.ndarray) -> bool:
    try:
        check_samples(samples.inputs[~held_out], samples.target[~held_out])
    except NotTrainable:
        return False
    return True


def effective_sample_ratio(error: np.ndarray, take: np.ndarray, position: np.ndarray) -> float:
    """Between 1 / N and 1, for errors (N,) at frames ``position`` (N,), whole numbers, of ``take`` (N,)."""
    whole = float(error @ error)
    if whole == 0.0:
        return 1.0
    products, pairs = _by_lag(error, take, position)
    total, start = whole, 1
    while start < len(pairs):
        end = start + max(1, int(WIDENING * start))
        while end < len(pairs) and pairs[start:end].sum() < LEAST_PAIRS:
            end += 1
        count, together = pairs[start:end].sum(), float(products[start:end].sum())
        if count == 0 or together / count <= FADED * whole / len(error):
            break
        total += 2.0 * together
        start = end
    return float(np.clip(whole / total, 1.0 / len(error), 1.0))


def _by_lag(error: np.ndarray, take: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sum of products of errors, and number of pairs, for each distance in frames within a take."""
    owned = [np.flatnonzero(take == owner) for owner in np.unique(take)]
    longest = max(int(np.ptp(position[rows])) + 1 for rows in owned)
    products, pairs = np.zeros(longest), np.zeros(longest)
    for rows in owned:
        at = position[rows] - position[rows].min()
        length = int(at.max()) + 1
        frames = np.zeros((2, length))
        frames[0, at], frames[1, at] = error[rows], 1.0
        size = 1 << int(2 * length - 1).bit_length()
        power = np.abs(np.fft.rfft(frames, size)) ** 2
        correlated = np.fft.irfft(power, size)[:, :length]
        products[:length] += correlated[0]
        pairs[:length] += np.round(correlated[1])
    return products, pairs
