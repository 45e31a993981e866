"""How much each sample shall count in training a process: decided on takes left out.

The marginal likelihood takes errors for independent. Frames are not: on ankle sleeves walking at 200 Hz an
error lasts for tens of frames, and a process that is trained as if each were news follows single strides
(lengthscales of a fifth of the readings' spread) and can lose to a straight line on the next walk. A
composite likelihood, in which each sample counts for less than one, mends that (Pauli, Racugno & Ventura
2011); how much less is not told by the training errors, which the process has already bent to, so a few
weights are tried on takes left out. That is dear, so it is done only where there is need: the process uses
up a good part of the independent samples that there are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from glovecal_models.calibration.folds import folds_over_takes
from glovecal_models.calibration.independent_share import independent_share
from glovecal_models.errors import NotTrainable
from glovecal_models.regression.fast_lmc import fit_lmc_gpr
from glovecal_models.regression.process_regressor import ProcessRegressor
from glovecal_models.regression.training_check import check_samples

WEIGHTS = (1.0, 0.4, 0.2, 0.08, 0.03)
"""Tried in turn until the error on left-out takes rises; the last leaves little more than a plane."""
LEAST_WORTH = 10
"""Whole samples per coefficient of the plane that all samples together must count for."""
CROWDED = 0.5
"""Degrees of freedom of the process per independent sample, from which it may be following single ones."""
FOLDS = 3


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


@dataclass(frozen=True)
class Weighted:
    """A process, what each sample counted in its training, and why."""

    regressor: ProcessRegressor
    weight: float
    evidence: dict[str, Any] = field(default_factory=dict)


def fit_weighted(
    samples: Recorded,
    *,
    seed: int = 0,
    cancelled: Callable[[], bool] | None = None,
    report: Callable[[str, float], None] | None = None,
) -> Weighted:
    """The LMC-GPR of ``samples``, each counting what serves takes left out best.

    The regressor's evidence tells ``independent_share``, ``degrees_of_freedom`` and, where weights were
    tried, ``held_out_rmse_deg`` of each. Raises NotTrainable, Cancelled.
    """
    whole = fit_lmc_gpr(samples.inputs, samples.target, seed=seed, cancelled=cancelled, report=report)
    fitted = whole.predict(samples.inputs)
    share = independent_share(samples.target - fitted.mean, samples.take, samples.position)
    freedom = float(np.minimum(fitted.variance / max(whole.noise_variance, 1e-12), 1.0).sum())
    evidence: dict[str, Any] = {"independent_share": share, "degrees_of_freedom": freedom}
    if freedom <= CROWDED * share * len(samples.target):
        return Weighted(_with(whole, evidence), 1.0, evidence)
    if report:
        report("neighbouring frames err alike: trying on takes left out how much each shall count", 0.5)
    errors = _held_out_errors(samples, seed, cancelled)
    evidence["held_out_rmse_deg"] = {f"{weight:g}": error for weight, error in errors.items()}
    best = min(errors, key=lambda weight: (errors[weight], weight), default=1.0)
    if best < 1.0:
        whole = fit_lmc_gpr(
            samples.inputs, samples.target, sample_weight=best, seed=seed, cancelled=cancelled
        )
    return Weighted(_with(whole, evidence), best, evidence)


def weight_sentence(rotation: str, evidence: Mapping[str, Any]) -> str | None:
    """What a user should know of weights that were tried; None where there was no need to."""
    errors = evidence.get("held_out_rmse_deg")
    if not errors:
        return None
    weight = evidence["sample_weight"]
    tried = ", ".join(f"{error:.2f} degrees at {name}" for name, error in errors.items())
    return (
        f"{rotation} errs alike for many frames in a row: a frame tells "
        f"{evidence['independent_share']:.2f} as much as an independent sample would, so something that its "
        f"sensors do not read may turn it. Each sample was made to count {weight:g}, which does best on "
        f"takes left out ({tried})."
    )


def _held_out_errors(
    samples: Recorded, seed: int, cancelled: Callable[[], bool] | None
) -> dict[float, float]:
    """RMSE in degrees by weight; empty where too little is left to train on when takes are left out."""
    folds = [fold.held_out for fold in folds_over_takes(samples.take, FOLDS)]
    folds = [held_out for held_out in folds if _can_be_left_out(samples, held_out)]
    least = LEAST_WORTH * (samples.inputs.shape[1] + 1) / len(samples.target)
    errors: dict[float, float] = {}
    for weight in WEIGHTS if folds else ():
        if weight < min(least, 1.0):
            break
        each = [_squared_errors(samples, held_out, weight, seed, cancelled) for held_out in folds]
        errors[weight] = float(np.sqrt(np.concatenate(each).mean()))
        if errors[weight] > min(errors.values()):
            break
    return errors


def _can_be_left_out(samples: Recorded, held_out: np.ndarray) -> bool:
    try:
        check_samples(samples.inputs[~held_out], samples.target[~held_out])
    except NotTrainable:
        return False
    return True


def _squared_errors(
    samples: Recorded,
    held_out: np.ndarray,
    weight: float,
    seed: int,
    cancelled: Callable[[], bool] | None,
) -> np.ndarray:
    """Of a process that has not seen the samples ``held_out``, at these."""
    inputs, target = samples.inputs[~held_out], samples.target[~held_out]
    process = fit_lmc_gpr(inputs, target, sample_weight=weight, seed=seed, cancelled=cancelled)
    return (process.predict(samples.inputs[held_out]).mean - samples.target[held_out]) ** 2


def _with(regressor: ProcessRegressor, evidence: dict[str, Any]) -> ProcessRegressor:
    return replace(regressor, evidence=regressor.evidence | evidence)
