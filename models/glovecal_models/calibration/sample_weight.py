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

Samples whose noise is known in parts: a variance that the reference states for each, and what is left.

Noise of sample i: s^2 (g + v_i), v_i the stated variance, g what glove and model add on average, s^2 the
factor by which the stated variances are wrong (profiled out with the scale; 1 where they are right). g
follows from the errors of a fit that treats all samples alike: the mean square of errors less the mean
stated variance, as the moment estimator of DerSimonian & Laird (1986) has it for studies of unequal
precision.

Rows of the likelihood are multiplied by the root of their relative precision, as by the root of a count
(``merged_samples``): with a geometric mean of 1 the likelihood's value stays that of the samples themselves.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from glovecal_models.calibration.folds import folds_over_takes, usable_folds
from glovecal_models.errors import NotTrainable
from glovecal_models.progress import Cancel, Report, part
from glovecal_models.regression.fast_lmc import LmcOptimum, LmcSearch, finish_search, fit_lmc_gpr, fit_roughly
from glovecal_models.regression.linear_regressor import LinearRegressor, fit_linear
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_models.regression.training_samples import check_samples

LEAST_OWN_SHARE = 0.05
"""Of the mean stated variance: what a glove adds at least, so that no single sample decides."""
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
class SampleNoise:
    """Of N samples."""

    precision: np.ndarray
    """(N,), relative, with a geometric mean of 1."""
    own_variance: float
    """g, degrees squared."""
    own_precision: float
    """That a sample would have whose reference is exact."""

    def of_exact_reference(self, noise_variance: float) -> float:
        """The noise of a sample whose reference is exact, where one of precision 1 has ``noise_variance``."""
        return noise_variance / self.own_precision

    def evidence(self, noise_variance: float) -> dict[str, Any]:
        """``stated_variance_times``: s^2 above."""
        own = self.of_exact_reference(noise_variance)
        return {
            "stated_variance_times": own / self.own_variance,
            "own_noise_deg": float(np.sqrt(own)),
            "most_precise_over_least": float(self.precision.max() / self.precision.min()),
        }


def check_variance(variance: np.ndarray, samples: int) -> np.ndarray:
    """Stated variances (N,), degrees squared. Raises NotTrainable."""
    variance = np.asarray(variance, dtype=float)
    if variance.shape != (samples,) or not (np.isfinite(variance) & (variance >= 0)).all():
        raise NotTrainable(
            f"variances of the reference have shape {variance.shape}, expected ({samples},), finite and not "
            "negative"
        )
    return variance


def sample_noise(variance: np.ndarray, error: np.ndarray) -> SampleNoise | None:
    """From stated variances (N,) and the errors (N,) of a fit that treats all samples alike; None where all
    variances are equal, so that there is nothing to tell samples apart by."""
    mean = float(variance.mean())
    if np.ptp(variance) <= 1e-12 * mean:
        return None
    own = max(float(np.mean(error**2)) - mean, LEAST_OWN_SHARE * mean)
    logs = -np.log(own + variance)
    middle = float(logs.mean())
    return SampleNoise(np.exp(logs - middle), own, float(np.exp(-np.log(own) - middle)))


def with_stated_variance(
    process: ProcessRegressor,
    inputs: np.ndarray,
    target: np.ndarray,
    variance: np.ndarray,
    *,
    seed: int = 0,
    cancelled: Cancel | None = None,
) -> ProcessRegressor:
    """An LMC-GPR of ``inputs`` (N, D) and ``target`` (N,) anew, each sample with a variance (N,) of its own,
    degrees squared; ``process`` itself where all are equal.

    ``process``: trained on the same samples as if all were alike; the search begins at its optimum, and each
    sample counts as much. ``noise_variance`` becomes that of a sample whose reference is exact. Raises
    NotTrainable, Cancelled.
    """
    variance = check_variance(variance, len(target))
    noise = sample_noise(variance, process.predict(inputs).mean - target)
    if noise is None:
        return process
    search = LmcSearch.begin(
        inputs, target, sample_weight=process.evidence["sample_weight"], precision=noise.precision,
        start=process.evidence["optimum"], seed=seed, cancelled=cancelled,
    )  # fmt: skip
    found = finish_search(search, cancelled=cancelled)
    return replace(
        found,
        noise_variance=noise.of_exact_reference(found.noise_variance),
        evidence=found.evidence | noise.evidence(found.noise_variance),
    )


def fit_linear_with_variance(
    inputs: np.ndarray, target: np.ndarray, variance: np.ndarray | None, **options: Any
) -> LinearRegressor:
    """``fit_linear`` (its ``options``) by weighted least squares where variances (N,) are stated, degrees
    squared; ``noise_variance`` becomes that of a sample whose reference is exact."""
    alike = fit_linear(inputs, target, **options)
    if variance is None:
        return alike
    noise = sample_noise(check_variance(variance, len(target)), alike.predict(inputs).mean - target)
    if noise is None:
        return alike
    found = fit_linear(inputs, target, precision=noise.precision, **options)
    return replace(
        found,
        noise_variance=noise.of_exact_reference(found.noise_variance),
        evidence=found.evidence | noise.evidence(found.noise_variance),
    )


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
        self._folds = [
            held_out
            for _, held_out in usable_folds(
                folds, lambda kept: check_samples(samples.inputs[kept], samples.target[kept])
            )
        ]
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
