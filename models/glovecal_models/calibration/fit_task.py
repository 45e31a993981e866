"""One fit of one rotation: plain arrays in, plain arrays out, with a stable key.

A service can spread tasks over worker processes, keep finished ones by their key, and repeat only what was
in flight when it was killed.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np

from glovecal_models.calibration.kernel_choice import fit_best_kernel
from glovecal_models.calibration.methods import LINEAR_METHODS
from glovecal_models.calibration.people_prior import plane_of_people, takes_by_wearing
from glovecal_models.calibration.sample_weight import Recorded, fit_linear_with_variance, fit_weighted
from glovecal_models.calibration.template import fit_on_plane, plane_for
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.progress import Cancel, Report
from glovecal_models.regression.kernel_candidates import CHOOSING
from glovecal_models.regression.linear_regressor import fit_beside, rescale_readings
from glovecal_models.regression.regressor import Regressor
from glovecal_models.regression.spgp import fit_spgp


@dataclass(frozen=True)
class FitTask:
    """One fit: the whole of a rotation's samples (``fold`` None), all but a held-out fold, or all but some
    wearings, whose error is measured when the fits are assembled."""

    rotation: str
    fold: int | None
    inputs: np.ndarray
    target: np.ndarray
    take: np.ndarray
    """Index of the take that each sample comes from."""
    position: np.ndarray
    """Number of each sample's frame, counted through all takes."""
    held_out_inputs: np.ndarray
    held_out_target: np.ndarray
    sensors: tuple[str, ...]
    settings: TrainingSettings
    without: tuple[str, ...] = ()
    """Wearings that were left out whole."""
    known_gain: float | None = None
    """Degrees a count of the second of two inputs, where an equation of a template gives it."""
    variance: np.ndarray | None = None
    """Stated variance of each sample's reference, degrees squared; None: all alike."""
    wearings: tuple[str, ...] = ()
    """Of each take by its index, where other people's takes are a prior."""
    key: str = field(default="")

    def __post_init__(self) -> None:
        if not self.key:
            object.__setattr__(self, "key", _key(self))


@dataclass(frozen=True)
class FitResult:
    """What a task gives back, in the form a file can hold."""

    rotation: str
    fold: int | None
    arrays: dict[str, np.ndarray]
    settings: dict[str, Any]
    held_out_squared_error: float
    """Sum of squared errors on the held-out samples, degrees squared."""
    held_out_count: int
    without: tuple[str, ...] = ()
    """Wearings that were left out whole."""


def run_task(task: FitTask, cancelled: Cancel | None = None, report: Report | None = None) -> FitResult:
    """Fit one task. Raises Cancelled when ``cancelled()`` turns true, NotTrainable."""
    regressor = _fit(task, cancelled, report)
    error = 0.0
    if len(task.held_out_target):
        error = float(np.sum((regressor.predict(task.held_out_inputs).mean - task.held_out_target) ** 2))
    return FitResult(
        rotation=task.rotation,
        fold=task.fold,
        arrays=regressor.arrays(),
        settings=regressor.settings(),
        held_out_squared_error=error,
        held_out_count=len(task.held_out_target),
        without=task.without,
    )


def _fit(task: FitTask, cancelled: Cancel | None, report: Report | None) -> Regressor:
    settings = task.settings
    if settings.method == "raw":
        span = ACTIVE_RANGE_DEG.get(task.rotation)
        return rescale_readings(task.inputs, task.target, span, sensor_names=task.sensors)
    if task.known_gain is not None:
        return fit_beside(task.inputs, task.target, task.known_gain, sensor_names=task.sensors)
    people = plane_of_people(settings.people, task.rotation, task.sensors)
    if people is not None:
        own = takes_by_wearing(task.inputs, task.target, task.take, task.wearings)
        return people.regressor(own, settings.people_wearing or None)
    if settings.method in LINEAR_METHODS:
        return fit_linear_with_variance(
            task.inputs, task.target, task.variance, sensor_names=task.sensors, cancelled=cancelled
        )
    plane = plane_for(task.rotation, settings.prior) if settings.prior else None
    if plane is not None:
        return fit_on_plane(task.inputs, task.target, task.sensors, plane, cancelled=cancelled, report=report)
    samples = Recorded(task.inputs, task.target, task.take, task.position, task.variance)
    if settings.method in CHOOSING:
        thorough = task.fold is None  # what a user is shown; a fold only repeats the choice
        return fit_best_kernel(
            samples, task.rotation, settings, thorough=thorough, cancelled=cancelled, report=report
        )
    known = dict(settings.optima).get(task.rotation)
    start = fit_weighted(samples, known=known, seed=settings.seed, cancelled=cancelled, report=report)
    if settings.method == "lmc_gpr":
        return start.regressor
    sparse = fit_spgp(
        task.inputs,
        task.target,
        pseudo_inputs=settings.pseudo_inputs,
        iterations=settings.iterations,
        seed=settings.seed,
        start=start.regressor,
        sample_weight=start.weight,
        cancelled=cancelled,
        report=report,
    )
    return replace(sparse, evidence=sparse.evidence | start.evidence)


@cache
def _software() -> str:
    """The installed version: finding it reads the package's description on disk."""
    return version("glovecal-models")


def _key(task: FitTask) -> str:
    digest = hashlib.sha256()
    facts = {
        "rotation": task.rotation,
        "fold": task.fold,
        "sensors": task.sensors,
        "settings": asdict(task.settings),
        "software": _software(),
    }
    if task.without:
        facts["without"] = task.without
    if task.wearings:
        facts["wearings"] = task.wearings
    if task.known_gain is not None:
        facts["known_gain"] = task.known_gain
    digest.update(json.dumps(facts, sort_keys=True).encode())
    samples = (task.inputs, task.target, task.take, task.position)
    stated = () if task.variance is None else (task.variance,)
    for array in (*samples, task.held_out_inputs, task.held_out_target, *stated):
        digest.update(repr(array.shape).encode())
        digest.update(np.ascontiguousarray(array, dtype=np.float64).tobytes())
    return digest.hexdigest()
