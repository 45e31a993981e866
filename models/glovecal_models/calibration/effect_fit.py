"""Regressors and effects learned together, in turns.

With the effects' part taken from the reference the regressors are trained as ever; with the regressors'
prediction as each joint's own signal the effects' shapes and weights are fitted, beside a static map of the
same inputs, so that what the regressor can explain is not claimed by an effect. Two turns suffice for most:
on three simulated gloves (hysteresis, creep, donning) a third changed the error by less than 1 %. Slow creep
moves the regressors themselves, and needs more. Then forms are learned, and weights until both have settled.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from threading import Lock
from typing import Any

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect, EffectRequest, form_values
from glovecal_models.calibration.fit_task import FitResult, FitTask, run_task
from glovecal_models.calibration.fitted_effects import fitted_effects, with_curves
from glovecal_models.calibration.methods import LINEAR_METHODS
from glovecal_models.calibration.model import CalibrationModel, restore_regressor
from glovecal_models.calibration.prepared_takes import (
    OwnSignal,
    PreparedTakes,
    base_rows,
    joint_weights,
    signals_of_lanes,
)
from glovecal_models.calibration.samples import Samples, joined_variances, sampled_rows
from glovecal_models.calibration.template import palm_samples
from glovecal_models.calibration.training_plan import correspondence_by, task_for
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.layout import Correspondence
from glovecal_models.progress import Cancel, stop_if
from glovecal_models.regression.fast_lmc import LmcOptimum
from glovecal_models.regression.regressor import Regressor
from glovecal_models.worker_processes import side_by_side

MOST_TURNS = 4
MOST_WEIGHT_TURNS = 5
"""Once forms are learned, with shapes and forms as they are. A form may move the regressors as well: a
structure that is lost while bent, on top of which weights of the turn before doubled the error."""
SETTLED_SHARE = 0.1
"""Of the effects' part, by which it may still change when forms are learned."""
NOISE_SHARE = 0.15
"""Of a rotation's error, by which the effects' part may change in the end: what is left of a change stands in
every prediction, and ten percent of a large effect were 0.6 degrees beside a noise of 0.7."""


Optima = tuple[Mapping[str, LmcOptimum], ...]
"""What each rotation's training found, for each time that the regressors are trained."""


@dataclass(frozen=True)
class EffectFit:
    """Regressors of some rotations with the effects that correct them."""

    results: Mapping[str, FitResult]
    """For each rotation."""
    effects: tuple[AddedEffect, ...]
    optima: Optima = ()

    def regressor(self, rotation: str) -> Regressor:
        found = self.results[rotation]
        return restore_regressor(found.arrays, found.settings)


def fit_with_effects(
    takes: PreparedTakes,
    rotations: Sequence[str],
    wanted: Sequence[EffectRequest],
    settings: TrainingSettings,
    *,
    optima: Optima = (),
    cancelled: Cancel | None = None,
) -> EffectFit:
    """Train ``rotations`` with those of ``wanted`` that predict something.

    ``optima`` of a fit of the same with more takes: sample weights are not chosen again, and searches begin
    there. Raises NotTrainable, Cancelled.
    """
    wanted = [item for item in wanted if item.has_columns and set(item.rotations) & set(rotations)]
    columns = {name: correspondence_for(takes, name, settings) for name in rotations}
    corrected: dict[str, list[np.ndarray]] = {}
    results: dict[str, FitResult] = {}
    effects: tuple[AddedEffect, ...] = ()
    found: list[Mapping[str, LmcOptimum]] = []

    def trained() -> None:
        known = optima[min(len(found), len(optima) - 1)] if optima else {}
        moved = [name for name in rotations if not found or name in corrected]
        tasks = []
        for name in moved:
            # Only its own: the same fit is known again whatever other rotations are trained beside.
            own = ((name, known[name]),) if name in known else ()
            tasks.append(_task(takes, columns[name], corrected.get(name), replace(settings, optima=own)))
        results.update(zip(moved, KNOWN_FITS.fit(tasks, cancelled=cancelled), strict=True))
        found.append(found_optima({name: item.settings for name, item in results.items()}))

    def own_signals() -> dict[str, OwnSignal]:
        """What the regressors of the touched rotations say now."""
        return {
            name: OwnSignal.of(takes, columns[name], restore_regressor(item.arrays, item.settings))
            for name, item in results.items()
            if any(name in each.rotations for each in wanted)
        }

    is_linear = settings.method in LINEAR_METHODS

    def fit_effects(own: Mapping[str, OwnSignal], *, is_last: bool) -> None:
        nonlocal effects, corrected
        effects = fitted_effects(
            takes, columns, own, wanted, is_linear=is_linear, is_last=is_last, cancelled=cancelled
        )
        corrected = _explained(takes, own, effects)

    trained()
    if wanted:
        own = own_signals()
        for _ in range(MOST_TURNS):
            fit_effects(own, is_last=False)
            trained()
            own = own_signals()
            if _has_settled(corrected, _explained(takes, own, effects)):
                break
        fit_effects(own, is_last=True)
        trained()
        own = own_signals()
        for _ in range(MOST_WEIGHT_TURNS):
            if _is_within_noise(takes, own, corrected, _explained(takes, own, effects)):
                break
            effects = with_new_weights(effects, takes, columns, own, is_linear=is_linear)
            corrected = _explained(takes, own, effects)
            trained()
            own = own_signals()
    return EffectFit(results, effects, tuple(found))


def _has_settled(before: Mapping[str, list[np.ndarray]], after: Mapping[str, list[np.ndarray]]) -> bool:
    """Whether the effects' part, read from the regressors now, is what these were trained for."""
    then, now = (np.concatenate([part for name in after for part in each[name]]) for each in (before, after))
    return float(np.linalg.norm(now - then)) <= SETTLED_SHARE * float(np.linalg.norm(then))


def _is_within_noise(
    takes: PreparedTakes,
    own: Mapping[str, OwnSignal],
    before: Mapping[str, list[np.ndarray]],
    after: Mapping[str, list[np.ndarray]],
) -> bool:
    """Whether the effects' part has settled within what each rotation's fit leaves of the reference."""
    for name, parts in after.items():
        now = np.concatenate(parts)
        left = takes.target(name), own[name].takes
        error = np.concatenate([target - mean for target, mean in zip(*left, strict=True)]) - now
        rms = float(np.sqrt(np.nanmean(error**2)))
        if float(np.sqrt(np.mean((now - np.concatenate(before[name])) ** 2))) > NOISE_SHARE * rms:
            return False
    return True


def found_optima(settings: Mapping[str, Mapping[str, Any]]) -> dict[str, LmcOptimum]:
    """From the ``settings`` of each rotation's regressor; processes only."""
    found = {name: LmcOptimum.of(item.get("evidence", {})) for name, item in settings.items()}
    return {name: optimum for name, optimum in found.items() if optimum is not None}


def optima_of(model: CalibrationModel) -> Optima:
    """Where searches begin that train a model anew with fewer takes."""
    return (found_optima({item.rotation: item.regressor.settings() for item in model.rotations}),)


def correspondence_for(takes: PreparedTakes, rotation: str, settings: TrainingSettings) -> Correspondence:
    """What the rotation is read from; for a linear calibration its measuring sensor."""
    item = takes.layout.correspondence(rotation)
    return correspondence_by(settings.method, item, takes.layout.sensors)


def _task(
    takes: PreparedTakes,
    correspondence: Correspondence,
    correction: list[np.ndarray] | None,
    settings: TrainingSettings,
) -> FitTask:
    """To train the rotation's regressor on the reference without the effects' part."""
    targets, inputs = takes.target(correspondence.rotation), takes.inputs(correspondence)
    if correction is not None:
        targets = [target - part for target, part in zip(targets, correction, strict=True)]
    found = [
        sampled_rows(take, correspondence.rotation, target)
        for take, target in zip(takes.takes, targets, strict=True)
    ]
    known = [rows for rows, _ in found]
    poses = [
        np.array(take.poses if take.poses is not None else [""] * len(take.time_s), dtype=object)
        for take in takes.takes
    ]
    samples = Samples(
        np.concatenate([part[rows] for part, rows in zip(inputs, known, strict=True)]),
        np.concatenate([part[rows] for part, rows in zip(targets, known, strict=True)]),
        np.concatenate([np.full(len(rows), i) for i, rows in enumerate(known)]),
        np.concatenate([part[rows] for part, rows in zip(poses, known, strict=True)]),
        joined_variances([variance for _, variance in found], [len(rows) for rows in known]),
    )
    palm = palm_samples(takes.takes, correspondence) if settings.method == "template" else None
    return task_for(correspondence, samples, None, settings, palm=palm)


def _explained(
    takes: PreparedTakes,
    own: Mapping[str, OwnSignal],
    effects: Sequence[AddedEffect],
) -> dict[str, list[np.ndarray]]:
    """For each touched rotation and take (N,), what the effects add."""
    total: dict[str, list[np.ndarray]] = {}
    for added in effects:
        signals_of = (own[name].takes for name in added.rotations)
        values = [np.column_stack(parts) for parts in zip(*signals_of, strict=True)]
        signals = takes.signals(values, added.zero_deg, frozenset())
        for number, part in enumerate(added.corrections(signals)):
            for lane, name in enumerate(added.rotations):
                sums = total.setdefault(name, [np.zeros(len(item.time_s)) for item in takes.takes])
                sums[number] += part[:, lane]
    return total


# Fits that this process did before: folds, turns and trials of several effects ask for the same ones.
#
# Whatever effect is tried, the first turn trains the regressors of every fold without it; the same samples
# with the same settings are the same task, by its key.


MOST_BYTES = 64_000_000
"""Of arrays; the longest unused are forgotten first."""


class FitMemory:
    """Safe to use from several threads; two that ask for the same fit at once may both do it."""

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self._most, self._bytes, self._lock = most_bytes, 0, Lock()
        self._fits: OrderedDict[str, FitResult] = OrderedDict()

    def fit(self, tasks: Sequence[FitTask], *, cancelled: Cancel | None = None) -> list[FitResult]:
        """As ``run_task`` of each, whose results are never changed; side by side. Raises NotTrainable,
        Cancelled."""
        with self._lock:
            known = {task.key: self._fits[task.key] for task in tasks if task.key in self._fits}
        new = [task for task in tasks if task.key not in known]
        for task, result in zip(new, side_by_side(_fitted, new, cancelled), strict=True):
            known[task.key] = result
        with self._lock:
            for key, result in known.items():
                self._bytes += 0 if key in self._fits else _size(result)
                self._fits[key] = result
                self._fits.move_to_end(key)
            while self._bytes > self._most:
                self._bytes -= _size(self._fits.popitem(last=False)[1])
        return [known[task.key] for task in tasks]


def _fitted(task: FitTask, cancelled: Cancel | None) -> FitResult:
    stop_if(cancelled, "adding an effect")
    return run_task(task, cancelled)


def _size(result: FitResult) -> int:
    return sum(array.nbytes for array in result.arrays.values())


KNOWN_FITS = FitMemory()


# New weights of effects whose shapes and forms are known, on a base that has moved since.


def with_new_weights(
    effects: Sequence[AddedEffect],
    takes: PreparedTakes,
    columns: Mapping[str, Correspondence],
    own: Mapping[str, OwnSignal],
    *,
    is_linear: bool,
) -> tuple[AddedEffect, ...]:
    """``effects`` on the rotations of ``own``, all weights of a joint fitted together.

    ``columns``: for each rotation what it is read from. ``is_linear``: the base is a straight line.
    """
    rows = {name: takes.rows(name) for name in own}
    signals = [signals_of_lanes(takes, each.correction, each.rotations, columns, own) for each in effects]
    extra: dict[str, list[list[np.ndarray]]] = {name: [] for name in own}
    priors: dict[str, list[np.ndarray]] = {name: [] for name in own}
    every = [added.columns_of_takes(part) for added, part in zip(effects, signals, strict=True)]
    for added, found in zip(effects, every, strict=True):
        prior = added.correction.weights(added.settings).prior_sd
        prior = np.concatenate([prior, np.ones(added.weights.shape[1] - len(prior))])
        for lane, name in enumerate(added.rotations):
            extra[name].append([part[index, lane] for part, index in zip(found, rows[name], strict=True)])
            priors[name].append(prior)
    bases = {name: base_rows(takes, columns[name], rows[name], is_linear) for name in own}
    weights = {name: iter(joint_weights(bases[name], extra[name], priors[name])) for name in own}
    result = []
    for added, of_takes, found in zip(effects, signals, every, strict=True):
        mine = {name: next(weights[name]) for name in added.rotations}
        degrees = {name: [part @ item.mean for part in extra[name].pop(0)] for name, item in mine.items()}
        settings = added.settings
        if added.form is not None:
            values = [
                form_values(added.correction, take, part[:, :, : added.own_count], settings)
                for take, part in zip(of_takes, found, strict=True)
            ]
            settings = with_curves(settings, values, rows, degrees)
        result.append(
            replace(
                added,
                settings=settings,
                weights=np.array([item.mean for item in mine.values()]),
                zero_deg=np.array([own[name].zero_deg for name in added.rotations]),
                covariance=None
                if added.covariance is None
                else np.array([item.covariance for item in mine.values()]),
            )
        )
    return tuple(result)
