"""Which kernel serves a rotation, chosen by evidence and by the held-out error; and training with it.

All candidates are trained on the same few hundred samples, so that their likelihoods are of the same data in
the same units, and again without each fold of whole takes. Autocorrelated samples have the weight that
``fit_weighted`` found for LMC-GPR, in every candidate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.calibration.folds import folds_over_takes, usable_folds
from glovecal_models.calibration.sample_weight import Recorded, fit_weighted
from glovecal_models.calibration.samples import Samples, representative_index
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import BadInput, NotTrainable
from glovecal_models.names import did_you_mean
from glovecal_models.progress import Cancel, Report, part
from glovecal_models.regression.kernel_candidates import CANDIDATE, LMC, KernelCandidate, candidates_of
from glovecal_models.regression.kernel_scores import CandidateScore, KernelScores, with_choice
from glovecal_models.regression.linear_regressor import fit_linear
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_models.regression.training_samples import check_samples

TRIED_SAMPLES = 500
"""Enough to tell kernels apart by tens of nats; an exact fit takes a second."""
FOLDS = 3
FOLD_ITERATIONS = 25
"""From the optimum of all tried samples, that without a fold is near."""
LAST_ITERATIONS = 15
"""On all samples, from the optimum of some: more would move the hyperparameters by less than their doubt."""


@dataclass(frozen=True)
class Tried:
    """The scores and, by candidate, the optimum (working units) from which a fit on all samples starts."""

    scores: KernelScores
    optimum: dict[str, list[float]]


def score_candidates(
    samples: Recorded,
    candidates: Sequence[KernelCandidate],
    *,
    sample_weight: float = 1.0,
    thorough: bool = True,
    seed: int = 0,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> Tried:
    """Score ``candidates``, the first being the one that stays unless another is clearly better.

    ``sample_weight`` is what each of all ``samples`` counts; the tried ones are further apart in time and
    count more. Unless ``thorough``, an error on takes left out is measured only where the evidence is clear:
    the choice is the same. A candidate that cannot be fitted has no score. Raises NotTrainable, Cancelled.
    """
    trial = _Trial.of(samples, sample_weight, seed, cancelled)
    optimum: dict[str, list[float]] = {}
    scores: list[CandidateScore] = []
    straight_line, spread = trial.scale()
    for number, candidate in enumerate(candidates):
        if report:
            report(f"trying {candidate.words}", number / len(candidates))
        try:
            whole = candidate.fit(
                trial.inputs, trial.target, sample_weight=trial.weight, seed=seed, cancelled=cancelled
            )
        except NotTrainable:
            if number == 0:
                raise
            continue
        score = trial.by_evidence(candidate, whole)
        so_far = KernelScores((*scores, score), len(trial.target), trial.weight, straight_line, spread)
        if thorough or number == 0 or so_far.has_clear_evidence(score):
            score = trial.with_errors(score, candidate, whole)
        optimum[candidate.name] = whole.evidence.get("parameters", [])
        scores.append(score)
    found = KernelScores(tuple(scores), len(trial.target), trial.weight, straight_line, spread)
    return Tried(found, optimum)


@dataclass(frozen=True)
class _Trial:
    """The samples that candidates are tried on, and the folds that are left out."""

    samples: Recorded
    chosen: np.ndarray
    """Indices of the tried samples, increasing."""
    folds: tuple[np.ndarray, ...]
    """Masks (N,) over all samples."""
    weight: float
    seed: int
    cancelled: Cancel | None

    @classmethod
    def of(cls, samples: Recorded, sample_weight: float, seed: int, cancelled: Cancel | None) -> _Trial:
        chosen = _spread(samples, seed)
        weight = min(1.0, sample_weight * len(samples.target) / len(chosen))
        return cls(samples, chosen, tuple(_usable_folds(samples, chosen)), weight, seed, cancelled)

    @property
    def inputs(self) -> np.ndarray:
        return self.samples.inputs[self.chosen]

    @property
    def target(self) -> np.ndarray:
        return self.samples.target[self.chosen]

    def scale(self) -> tuple[float | None, float | None]:
        """Held-out RMSE of a plane through the same samples, and the angle's spread, degrees."""
        if not self.folds:
            return None, None
        squared = []
        for held_out in self.folds:
            inputs, target = self._without(held_out)
            plane = fit_linear(inputs, target).predict(self.samples.inputs[held_out]).mean
            squared.append((plane - self.samples.target[held_out]) ** 2)
        left_out = self.samples.target[np.any(self.folds, axis=0)]
        return float(np.sqrt(np.concatenate(squared).mean())), float(left_out.std())

    def by_evidence(self, candidate: KernelCandidate, whole: ProcessRegressor) -> CandidateScore:
        """The NLML in degrees: a density per standard deviation becomes one per degree."""
        nlml, scale = whole.evidence["nlml"], whole.evidence["target_scale_deg"]
        nlml += self.weight * len(self.target) * float(np.log(scale))
        return CandidateScore(candidate.name, float(nlml), candidate.parameters(self.inputs.shape[1]))

    def with_errors(
        self, score: CandidateScore, candidate: KernelCandidate, whole: ProcessRegressor
    ) -> CandidateScore:
        """``score`` with the errors of the candidate trained without each fold, at all its samples."""
        if not self.folds:
            return score
        start = whole.evidence.get("parameters")
        search = {"start": start, "iterations": FOLD_ITERATIONS} if start else {}
        every, by_take = [], []
        for held_out in self.folds:
            process = candidate.fit(
                *self._without(held_out),
                sample_weight=self.weight, seed=self.seed, cancelled=self.cancelled, **search,
            )  # fmt: skip
            left = self.samples.inputs[held_out], self.samples.target[held_out], self.samples.take[held_out]
            squared = (process.predict(left[0]).mean - left[1]) ** 2
            every.append(squared)
            by_take += [float(np.sqrt(squared[left[2] == take].mean())) for take in np.unique(left[2])]
        rmse = float(np.sqrt(np.concatenate(every).mean()))
        return replace(score, held_out_rmse_deg=rmse, rmse_by_take_deg=tuple(by_take))

    def _without(self, held_out: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The tried samples that are not left out: inputs and target."""
        kept = self.chosen[~held_out[self.chosen]]
        return self.samples.inputs[kept], self.samples.target[kept]


def _spread(samples: Recorded, seed: int) -> np.ndarray:
    none = np.full(len(samples.target), "", dtype=object)
    every = Samples(samples.inputs, samples.target, samples.take, none)
    return representative_index(every, TRIED_SAMPLES, seed=seed)


def _usable_folds(samples: Recorded, chosen: np.ndarray) -> list[np.ndarray]:
    """Masks (N,) of what is left out; of those whose rest can carry a model."""

    def check_rest(kept: np.ndarray) -> None:
        some = chosen[kept[chosen]]
        check_samples(samples.inputs[some], samples.target[some])

    folds = folds_over_takes(samples.take, FOLDS)
    return [held_out for _, held_out in usable_folds((fold.held_out for fold in folds), check_rest)]


def fit_best_kernel(
    samples: Recorded,
    rotation: str,
    settings: TrainingSettings,
    *,
    thorough: bool = True,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> ProcessRegressor:
    """Choose among the method's candidates and train the chosen one on all ``samples``.

    LMC-GPR comes first: where it stays, the process is what method ``lmc_gpr`` trains; and it tells what
    each sample counts in all others. Raises NotTrainable, Cancelled, BadInput (an unknown kernel).
    """
    kept = dict(settings.kernels).get(rotation)
    if kept is not None and kept not in CANDIDATE:
        raise BadInput(f"no kernel {kept!r} for {rotation}; {did_you_mean(kept, CANDIDATE)}")
    candidates = (CANDIDATE[kept],) if kept else candidates_of(settings.method)
    base = fit_weighted(
        samples, known=dict(settings.optima).get(rotation), seed=settings.seed,
        cancelled=cancelled, report=part(report, 0.0, 0.2),
    )  # fmt: skip
    if kept == LMC:
        return base.regressor
    chosen, scores, search = candidates[0], None, {}
    if len(candidates) > 1:
        tried = score_candidates(
            samples, candidates, sample_weight=base.weight, thorough=thorough, seed=settings.seed,
            cancelled=cancelled, report=part(report, 0.2, 0.7),
        )  # fmt: skip
        scores, chosen = tried.scores, CANDIDATE[tried.scores.chosen.name]
        search = {"start": tried.optimum[chosen.name]}
    process = base.regressor
    if chosen.name != LMC:
        if report:
            report(f"training {chosen.words} on {len(samples.target)} samples", 0.7)
        process = chosen.fit(
            samples.inputs, samples.target, sample_weight=base.weight, seed=settings.seed,
            cancelled=cancelled, iterations=LAST_ITERATIONS, **search,
        )  # fmt: skip
        process = replace(process, evidence=process.evidence | base.evidence)
    return process if scores is None else with_choice(process, scores)
