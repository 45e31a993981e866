"""Regressors and effects learned together, in turns.

With the effects' part taken from the reference the regressors are trained as ever; with the regressors'
prediction as each joint's own signal the effects' shapes and weights are fitted, beside a static map of the
same inputs, so that what the regressor can explain is not claimed by an effect. Two turns suffice for most:
on three simulated gloves (hysteresis, creep, donning) a third changed the error by less than 1 %. Slow creep
moves the regressors themselves, and needs more.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from glovecal_models.calibration.added_effect import CURVES, FORM, AddedEffect, form_values
from glovecal_models.calibration.effect_request import EffectRequest
from glovecal_models.calibration.effect_shape import REFINEMENTS, EffectGroup, best_shape
from glovecal_models.calibration.fit_memory import KNOWN_FITS
from glovecal_models.calibration.fit_task import FitResult
from glovecal_models.calibration.form_choice import EVERY as FORM_EVERY
from glovecal_models.calibration.form_choice import FormRows, chosen_columns, chosen_form
from glovecal_models.calibration.held_out import BaseFeatures, Rows, WeightPosterior, weight_posterior
from glovecal_models.calibration.model import CalibrationModel, restore_regressor
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.samples import Samples, linear_correspondence
from glovecal_models.calibration.training_plan import task_for
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.form_curve import LaneCurves
from glovecal_models.effects.base.learned_form import LearnedForm
from glovecal_models.layout import Correspondence
from glovecal_models.progress import Cancel, stop_if
from glovecal_models.regression.lmc_search import LmcOptimum
from glovecal_models.regression.regressor import Regressor

MOST_TURNS = 5
SETTLED_SHARE = 0.1
"""Of the effects' part, by which it may still change when the regressors have been trained anew."""


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
        for name in rotations:
            stop_if(cancelled, "adding an effect")
            # Only its own: the same fit is known again whatever other rotations are trained beside.
            own = ((name, known[name]),) if name in known else ()
            chosen = replace(settings, optima=own)
            results[name] = _trained(takes, columns[name], corrected.get(name), chosen, cancelled)
        found.append(found_optima({name: item.settings for name, item in results.items()}))

    def fit_effects(*, is_last: bool) -> None:
        nonlocal effects, corrected
        regressors = {name: restore_regressor(item.arrays, item.settings) for name, item in results.items()}
        effects = _fitted_effects(takes, columns, regressors, wanted, settings, is_last, cancelled)
        corrected = _explained(takes, columns, regressors, effects)

    def has_settled() -> bool:
        """Whether the effects, read from what the regressors say now, are what these were trained for."""
        regressors = {name: restore_regressor(item.arrays, item.settings) for name, item in results.items()}
        now = _explained(takes, columns, regressors, effects)
        before, after = (
            np.concatenate([part for name in now for part in each[name]]) for each in (corrected, now)
        )
        return float(np.linalg.norm(after - before)) <= SETTLED_SHARE * float(np.linalg.norm(before))

    trained()
    if wanted:
        for _ in range(MOST_TURNS - 1):
            fit_effects(is_last=False)
            trained()
            if has_settled():
                break
        fit_effects(is_last=True)
        trained()
    return EffectFit(results, effects, tuple(found))


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
    return linear_correspondence(item) if settings.method in ("raw", "linear") else item


def _trained(
    takes: PreparedTakes,
    correspondence: Correspondence,
    correction: list[np.ndarray] | None,
    settings: TrainingSettings,
    cancelled: Cancel | None,
) -> FitResult:
    """The rotation's regressor, trained on the reference without the effects' part."""
    targets, inputs = takes.target(correspondence.rotation), takes.inputs(correspondence)
    if correction is not None:
        targets = [target - part for target, part in zip(targets, correction, strict=True)]
    known = [np.isfinite(target) for target in targets]
    poses = [
        np.array(take.poses if take.poses is not None else [""] * len(take.time_s), dtype=object)
        for take in takes.takes
    ]
    samples = Samples(
        np.concatenate([part[rows] for part, rows in zip(inputs, known, strict=True)]),
        np.concatenate([part[rows] for part, rows in zip(targets, known, strict=True)]),
        np.concatenate([np.full(int(rows.sum()), i) for i, rows in enumerate(known)]),
        np.concatenate([part[rows] for part, rows in zip(poses, known, strict=True)]),
    )
    return KNOWN_FITS.fit(task_for(correspondence, samples, None, settings), cancelled=cancelled)


def own_signals(
    takes: PreparedTakes, correspondence: Correspondence, regressor: Regressor
) -> tuple[list[np.ndarray], float]:
    """For each take (N,), the base's prediction; and what it would be at a raw reading of zero."""
    inputs = takes.inputs(correspondence)
    own = [_predicted(regressor, part) for part in inputs]
    x, y = np.concatenate([part[:, 0] for part in inputs]), np.concatenate(own)
    variance = float(np.var(x))
    slope = float(np.mean((x - x.mean()) * (y - y.mean()))) / variance if variance > 0 else 0.0
    return own, float(y.mean() - slope * x.mean())


def _predicted(regressor: Regressor, inputs: np.ndarray) -> np.ndarray:
    """(N,), degrees; a single sensor's counts come again and again, and each is predicted once."""
    if inputs.shape[1] > 1:
        return regressor.mean(inputs)
    different, which = np.unique(inputs[:, 0], return_inverse=True)
    return regressor.mean(different[:, None])[which]


def _fitted_effects(
    takes: PreparedTakes,
    columns: Mapping[str, Correspondence],
    regressors: Mapping[str, Regressor],
    wanted: Sequence[EffectRequest],
    settings: TrainingSettings,
    is_last: bool,
    cancelled: Cancel | None,
) -> tuple[AddedEffect, ...]:
    """Shapes and forms one effect after another, then all weights of a joint together."""
    touched = [name for name in columns if any(name in item.rotations for item in wanted)]
    own = {name: own_signals(takes, columns[name], regressors[name]) for name in touched}
    groups = [group for item in wanted for group in _groups(takes, item, columns, own)]
    rows = {name: takes.rows(name) for name in touched}
    linear = settings.method in ("raw", "linear")
    bases = {name: _base(takes, columns[name], rows[name], linear) for name in touched}
    extra: dict[str, list[list[np.ndarray]]] = {name: [] for name in touched}
    priors: dict[str, list[np.ndarray]] = {name: [] for name in touched}
    shapes: list[np.ndarray] = []
    inputs: dict[int, dict[str, dict[str, np.ndarray]]] = {}
    for place, group in enumerate(groups):
        stop_if(cancelled, "adding an effect")
        # The first turn's shapes only tell the base what to leave out: the grid is fine enough for that.
        shape = best_shape(group, rows, bases, extra, refinements=REFINEMENTS if is_last else 0)
        shapes.append(shape)
        effect = group.wanted.effect
        if is_last:
            group = groups[place] = _with_curves(group, shape, rows, bases, extra, priors)
        found = effect.columns_of_takes(group.signals, group.settings, shape)
        own_prior = effect.prior_sd(group.settings)
        for lane, name in enumerate(group.lanes):
            extra[name].append([part[index, lane] for part, index in zip(found, rows[name], strict=True)])
            priors[name].append(own_prior)
        if is_last:  # while the base still holds a part of the effect, its form cannot be seen
            values = [
                form_values(effect, take, part, group.settings)
                for take, part in zip(group.signals, found, strict=True)
            ]
            form = _learned_form(group, values, rows, bases, extra, priors)
            if form is not None:
                groups[place] = replace(group, settings=group.settings | {FORM: form.to_document()})
                inputs[place] = _form_inputs(group, form, values, rows)
    weights = {name: _weights(bases[name], extra[name], priors[name]) for name in touched}
    used = dict.fromkeys(touched, 0)
    added = []
    for place, (group, shape) in enumerate(zip(groups, shapes, strict=True)):
        mine, curves = [], {}
        for name in group.lanes:
            mine.append(weights[name][used[name]])
            if place in inputs and any(map(len, rows[name])):
                degrees = np.concatenate(extra[name][used[name]]) @ mine[-1].mean
                drawn = LaneCurves.over(inputs[place][name], group.wanted.effect.form_unit, degrees)
                curves[name] = drawn.to_document()
            used[name] += 1
        zero = np.array([own[name][1] for name in group.lanes])
        mean = np.array([each.mean for each in mine])
        is_told = group.wanted.effect.tells_own_uncertainty
        covariance = None if is_told else np.array([each.covariance for each in mine])
        settled = group.settings
        if curves:
            settled = settled | {FORM: settled[FORM] | {CURVES: curves}}
        added.append(
            AddedEffect(group.wanted.name, group.lanes, settled, shape, mean, zero, covariance=covariance)
        )
    return tuple(added)


def _own_of_takes(rows: Sequence[int]) -> list[np.ndarray]:
    """For each take (N, takes): one in its own column."""
    return [np.eye(len(rows))[np.full(count, at)] for at, count in enumerate(rows)]


def _form_rows(
    base: Sequence[Rows],
    extra: Sequence[Sequence[np.ndarray]],
    priors: Sequence[np.ndarray],
    take_sd_deg: float,
    inputs: Mapping[str, np.ndarray],
) -> FormRows:
    """Of one lane, with each of ``inputs`` (N,) on the rows that count."""
    own = [np.column_stack([part[::FORM_EVERY] for part in parts]) for parts in zip(*extra, strict=True)]
    prior = np.concatenate(priors)
    if take_sd_deg:
        of_takes = _own_of_takes([len(part) for part in own])
        own = [np.column_stack(parts) for parts in zip(own, of_takes, strict=True)]
        prior = np.append(prior, np.full(len(of_takes), take_sd_deg))
    return FormRows(
        np.concatenate([unit.base[::FORM_EVERY] for unit in base]),
        np.concatenate(own),
        prior,
        {key: column[:, None] for key, column in inputs.items()},
        np.concatenate([unit.target[::FORM_EVERY] for unit in base]),
    )


def _with_curves(
    group: EffectGroup,
    shape: np.ndarray,
    rows: Mapping[str, Sequence[np.ndarray]],
    bases: Mapping[str, list[Rows]],
    extra: Mapping[str, list[list[np.ndarray]]],
    priors: Mapping[str, list[np.ndarray]],
) -> EffectGroup:
    """With those of the effect's further columns that the takes ask for; ``extra`` are of effects before."""
    effect = group.wanted.effect
    choices = [group.settings, *effect.settings_with_curves(group.signals, group.settings)]
    if len(choices) == 1:
        return group

    def lanes(settings: Settings) -> list[FormRows]:
        found = [effect.columns(take, settings, shape) for take in group.signals]
        prior = effect.prior_sd(settings)
        problems = []
        for lane, name in enumerate(group.lanes):
            mine = [part[index, lane] for part, index in zip(found, rows[name], strict=True)]
            every, sd = [*extra[name], mine], [*priors[name], prior]
            problems.append(_form_rows(bases[name], every, sd, effect.take_sd_deg, {}))
        return problems

    return replace(group, settings=choices[chosen_columns(map(lanes, choices))])


def _learned_form(
    group: EffectGroup,
    values: Sequence[Mapping[str, np.ndarray]],
    rows: Mapping[str, Sequence[np.ndarray]],
    bases: Mapping[str, list[Rows]],
    extra: Mapping[str, list[list[np.ndarray]]],
    priors: Mapping[str, list[np.ndarray]],
) -> LearnedForm | None:
    """What the takes ask for beyond the effect's own columns, which stand last in ``extra``; the form's
    columns are joined to those. ``values``: for each take the form's possible inputs (N, L)."""
    lanes = group.lanes
    if not values or not values[0]:
        return None
    problems = []
    for lane, name in enumerate(lanes):
        some = [index[::FORM_EVERY] for index in rows[name]]
        inputs = {
            key: np.concatenate([take[key][index, lane] for take, index in zip(values, some, strict=True)])
            for key in values[0]
        }
        sd = group.wanted.effect.take_sd_deg
        problems.append(_form_rows(bases[name], extra[name], priors[name], sd, inputs))
    terms = chosen_form(problems)
    if not terms:
        return None
    form = LearnedForm.over(terms, values)
    for lane, name in enumerate(lanes):
        for number, (take, index) in enumerate(zip(values, rows[name], strict=True)):
            learned = form.of_lane(lane).columns(
                {key: column[index][:, [lane]] for key, column in take.items()}
            )
            extra[name][-1][number] = np.column_stack([extra[name][-1][number], learned[:, 0, :]])
        priors[name][-1] = np.concatenate([priors[name][-1], np.ones(form.count)])
    return form


def _form_inputs(
    group: EffectGroup,
    form: LearnedForm,
    values: Sequence[Mapping[str, np.ndarray]],
    rows: Mapping[str, Sequence[np.ndarray]],
) -> dict[str, dict[str, np.ndarray]]:
    """For each lane the fitted rows (N,) of each input that the form uses."""
    used = dict.fromkeys(key for term in form.terms for key in term.inputs)
    return {
        name: {
            key: np.concatenate(
                [take[key][index, lane] for take, index in zip(values, rows[name], strict=True)]
            )
            for key in used
        }
        for lane, name in enumerate(group.lanes)
    }


def _groups(
    takes: PreparedTakes,
    item: EffectRequest,
    columns: Mapping[str, Correspondence],
    own: Mapping[str, tuple[list[np.ndarray], float]],
) -> list[EffectGroup]:
    names = [name for name in item.rotations if name in own]
    sets = [(name,) for name in names] if item.effect.one_joint_at_a_time else [tuple(names)]
    groups = []
    for lanes in sets:
        values = [np.column_stack(parts) for parts in zip(*(own[name][0] for name in lanes), strict=True)]
        without = frozenset(columns[lanes[0]].sensors) if item.effect.one_joint_at_a_time else frozenset()
        signals = takes.signals(values, np.array([own[name][1] for name in lanes]), without)
        groups.append(EffectGroup(item, lanes, signals, item.effect.fit_repair_constants(signals)))
    return groups


def _base(
    takes: PreparedTakes, correspondence: Correspondence, rows: Sequence[np.ndarray], linear: bool
) -> list[Rows]:
    inputs = takes.inputs(correspondence)
    features = BaseFeatures.fit_constants(inputs, linear=linear)
    return [
        Rows(features.columns(part[index]), target[index])
        for part, target, index in zip(inputs, takes.target(correspondence.rotation), rows, strict=True)
    ]


def _weights(
    base: list[Rows], extra: list[list[np.ndarray]], priors: list[np.ndarray]
) -> list[WeightPosterior]:
    """For each effect of one joint, all fitted together."""
    together = [np.column_stack(parts) for parts in zip(*extra, strict=True)]
    whole = weight_posterior(base, together, np.concatenate(priors))
    ends = np.cumsum([0, *(len(part) for part in priors)])
    return [whole.part(slice(start, end)) for start, end in itertools.pairwise(ends)]


def _explained(
    takes: PreparedTakes,
    columns: Mapping[str, Correspondence],
    regressors: Mapping[str, Regressor],
    effects: Sequence[AddedEffect],
) -> dict[str, list[np.ndarray]]:
    """For each touched rotation and take (N,), what the effects add."""
    total: dict[str, list[np.ndarray]] = {}
    for added in effects:
        own = [own_signals(takes, columns[name], regressors[name])[0] for name in added.rotations]
        values = [np.column_stack(parts) for parts in zip(*own, strict=True)]
        signals = takes.signals(values, added.zero_deg, frozenset())
        for number, part in enumerate(added.corrections(signals)):
            for lane, name in enumerate(added.rotations):
                sums = total.setdefault(name, [np.zeros(len(item.time_s)) for item in takes.takes])
                sums[number] += part[:, lane]
    return total
