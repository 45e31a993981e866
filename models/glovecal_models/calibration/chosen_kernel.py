"""One rotation's process with the kernel that fits it, or that was chosen for it before."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from glovecal_models.calibration.kernel_choice import try_candidates
from glovecal_models.calibration.sample_weight import Recorded, fit_weighted
from glovecal_models.calibration.training_settings import Report, TrainingSettings
from glovecal_models.errors import BadInput
from glovecal_models.regression.kernel_candidates import CANDIDATE, LMC, candidates_of
from glovecal_models.regression.kernel_scores import with_choice
from glovecal_models.regression.process_regressor import ProcessRegressor

LAST_ITERATIONS = 15
"""On all samples, from the optimum of some: more would move the hyperparameters by less than their doubt."""


def fit_chosen(
    samples: Recorded,
    rotation: str,
    settings: TrainingSettings,
    *,
    thorough: bool = True,
    cancelled: Callable[[], bool] | None = None,
    report: Report | None = None,
) -> ProcessRegressor:
    """Choose among the method's candidates and train the chosen one on all ``samples``.

    LMC-GPR comes first: where it stays, the process is what method ``lmc_gpr`` trains; and it tells what
    each sample counts in all others. Raises NotTrainable, Cancelled, BadInput (an unknown kernel).
    """
    kept = dict(settings.kernels).get(rotation)
    if kept is not None and kept not in CANDIDATE:
        raise BadInput(f"no kernel {kept!r} for {rotation}; there are {', '.join(CANDIDATE)}")
    candidates = (CANDIDATE[kept],) if kept else candidates_of(settings.method)
    base = fit_weighted(samples, seed=settings.seed, cancelled=cancelled, report=_part(report, 0.0, 0.2))
    if kept == LMC:
        return base.regressor
    chosen, scores, search = candidates[0], None, {}
    if len(candidates) > 1:
        tried = try_candidates(
            samples, candidates, sample_weight=base.weight, thorough=thorough, seed=settings.seed,
            cancelled=cancelled, report=_part(report, 0.2, 0.7),
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


def _part(report: Report | None, low: float, high: float) -> Report | None:
    if report is None:
        return None
    return lambda sentence, share: report(sentence, low + (high - low) * share)
