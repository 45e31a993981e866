"""Shapes, forms and weights of effects on top of a base that is given.

Shapes and forms are found one effect after another, then all weights of a joint together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.calibration.added_effect import CURVES, FORM, AddedEffect, EffectRequest, form_values
from glovecal_models.calibration.form_choice import FormRows, chosen_columns, chosen_form
from glovecal_models.calibration.held_out import (
    BaseProducts,
    FittedColumns,
    FittedRows,
    Rows,
    held_out,
)
from glovecal_models.calibration.prepared_takes import (
    OwnSignal,
    PreparedTakes,
    base_rows,
    joint_weights,
    signals_of_lanes,
)
from glovecal_models.effects.base.column_steps import IN_STEPS, learned_steps
from glovecal_models.effects.base.context_effect import ContextEffect
from glovecal_models.effects.base.effect import CorrectionEffect, FormSignals
from glovecal_models.effects.base.form_curve import LaneCurves
from glovecal_models.effects.base.learned_form import LearnedForm
from glovecal_models.effects.base.signals import Settings, Signals
from glovecal_models.layout import Correspondence
from glovecal_models.progress import Cancel, stop_if


def fitted_effects(
    takes: PreparedTakes,
    columns: Mapping[str, Correspondence],
    own: Mapping[str, OwnSignal],
    wanted: Sequence[EffectRequest],
    *,
    is_linear: bool,
    is_last: bool,
    cancelled: Cancel | None,
) -> tuple[AddedEffect, ...]:
    """``wanted`` on the rotations of ``own``; forms and further columns are learned where ``is_last``.

    ``is_linear``: the base is a straight line. Raises Cancelled.
    """
    touched = list(own)
    groups = [group for item in wanted for group in _groups(takes, item, columns, own)]
    rows = {name: takes.rows(name) for name in touched}
    bases = {name: base_rows(takes, columns[name], rows[name], is_linear) for name in touched}
    extra: dict[str, list[list[np.ndarray]]] = {name: [] for name in touched}
    priors: dict[str, list[np.ndarray]] = {name: [] for name in touched}
    shapes: list[np.ndarray] = []
    inputs: dict[int, list[FormSignals]] = {}
    for place, group in enumerate(groups):
        stop_if(cancelled, "adding an effect")
        # The first turn's shapes only tell the base what to leave out: the grid is fine enough for that.
        shape = best_shape(group, rows, bases, extra, refinements=REFINEMENTS if is_last else 0)
        shapes.append(shape)
        effect = group.effect
        if is_last:
            group = groups[place] = _with_curves(group, shape, rows, bases, extra, priors)
            group = groups[place] = _with_steps(group, shape, rows, bases, extra)
        found = effect.dynamics.columns_of_takes(group.signals, group.settings, shape)
        own_prior = effect.weights(group.settings).prior_sd
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
                inputs[place] = values
    weights = {name: joint_weights(bases[name], extra[name], priors[name]) for name in touched}
    used = dict.fromkeys(touched, 0)
    added = []
    for place, (group, shape) in enumerate(zip(groups, shapes, strict=True)):
        mine, degrees = [], {}
        for name in group.lanes:
            mine.append(weights[name][used[name]])
            degrees[name] = [part @ mine[-1].mean for part in extra[name][used[name]]]
            used[name] += 1
        settled = group.settings
        if place in inputs:
            settled = with_curves(settled, inputs[place], rows, degrees)
        zero = np.array([own[name].zero_deg for name in group.lanes])
        mean = np.array([each.mean for each in mine])
        of_wearings = group.effect.weights(group.settings).of_wearings
        covariance = None if of_wearings is not None else np.array([each.covariance for each in mine])
        added.append(
            AddedEffect(group.wanted.name, group.lanes, settled, shape, mean, zero, covariance=covariance)
        )
    return tuple(added)


def _form_rows(
    base: Sequence[Rows],
    extra: Sequence[Sequence[np.ndarray]],
    priors: Sequence[np.ndarray],
    take_sd_deg: float,
    inputs: Sequence[Mapping[str, np.ndarray]] = (),
) -> FormRows:
    """Of one lane; ``extra`` for each effect so far its columns in each take."""
    own = [np.column_stack(parts) for parts in zip(*extra, strict=True)]
    return FormRows.of(base, own, np.concatenate(priors), range(len(base)), take_sd_deg, inputs)


def _with_curves(
    group: EffectGroup,
    shape: np.ndarray,
    rows: Mapping[str, Sequence[np.ndarray]],
    bases: Mapping[str, list[Rows]],
    extra: Mapping[str, list[list[np.ndarray]]],
    priors: Mapping[str, list[np.ndarray]],
) -> EffectGroup:
    """With those of the effect's further columns that the takes ask for; ``extra`` are of effects before."""
    effect = group.effect
    choices = [group.settings, *effect.further.choices(group.signals, group.settings)]
    if len(choices) == 1:
        return group

    def lanes(settings: Settings) -> list[FormRows]:
        found = [effect.columns(take, settings, shape) for take in group.signals]
        prior = effect.weights(settings).prior_sd
        problems = []
        for lane, name in enumerate(group.lanes):
            mine = [part[index, lane] for part, index in zip(found, rows[name], strict=True)]
            every, sd = [*extra[name], mine], [*priors[name], prior]
            problems.append(_form_rows(bases[name], every, sd, 0.0))
        return problems

    return replace(group, settings=choices[chosen_columns(map(lanes, choices))])


def _with_steps(
    group: EffectGroup,
    shape: np.ndarray,
    rows: Mapping[str, Sequence[np.ndarray]],
    bases: Mapping[str, list[Rows]],
    extra: Mapping[str, list[list[np.ndarray]]],
) -> EffectGroup:
    """With the steps in which a slow cause acts, where none are known and these takes show them; ``extra`` as
    above."""
    effect = group.effect
    if not isinstance(effect, ContextEffect) or not effect.may_act_in_steps or IN_STEPS in group.settings:
        return group
    found = effect.dynamics.columns_of_takes(group.signals, group.settings, shape)
    left = []
    for lane, name in enumerate(group.lanes):
        mine = [part[index, lane] for part, index in zip(found, rows[name], strict=True)]
        units = [
            replace(unit, base=np.column_stack([unit.base, *columns]))
            for unit, *columns in zip(bases[name], *extra[name], mine, strict=True)
        ]
        fit = BaseProducts(units, own=bases[name][0].base.shape[1])
        left.append([unit.target - fit.fitted(unit.base) for unit in units])
    values = [effect.clipped(take, group.settings) for take in group.signals]
    steps = learned_steps(values, [rows[name] for name in group.lanes], left)
    return group if steps is None else replace(group, settings=group.settings | steps.to_settings())


def _learned_form(
    group: EffectGroup,
    values: Sequence[FormSignals],
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
        inputs = [
            {key: column[index][:, [lane]] for key, column in take.items()}
            for take, index in zip(values, rows[name], strict=True)
        ]
        sd = values[0].take_sd_deg
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


def with_curves(
    settings: Settings,
    values: Sequence[FormSignals],
    rows: Mapping[str, Sequence[np.ndarray]],
    degrees: Mapping[str, Sequence[np.ndarray]],
) -> Settings:
    """``settings`` with a learned form and, for each lane of ``degrees``, its picture: what the effect adds
    at the fitted rows over each input that the form uses. ``values``: for each take the inputs (N, L)."""
    form = LearnedForm.from_document(settings[FORM])
    used = dict.fromkeys(key for term in form.terms for key in term.inputs)
    curves = {}
    for lane, (name, parts) in enumerate(degrees.items()):
        if not any(map(len, parts)):
            continue
        inputs = {
            key: np.concatenate(
                [take[key][index, lane] for take, index in zip(values, rows[name], strict=True)]
            )
            for key in used
        }
        curves[name] = LaneCurves.over(inputs, values[0].unit, np.concatenate(parts)).to_document()
    return settings | {FORM: settings[FORM] | {CURVES: curves}} if curves else settings


def _groups(
    takes: PreparedTakes,
    item: EffectRequest,
    columns: Mapping[str, Correspondence],
    own: Mapping[str, OwnSignal],
) -> list[EffectGroup]:
    names, effect = [name for name in item.rotations if name in own], item.correction
    sets = [(name,) for name in names] if effect.comparison.is_joint_by_joint else [tuple(names)]
    groups = []
    for lanes in sets:
        signals = signals_of_lanes(takes, effect, lanes, columns, own)
        settings = effect.further.with_found(effect.further.constants(effect, signals), item.settings)
        groups.append(EffectGroup(item, effect, lanes, signals, settings))
    return groups


# The shape of an effect: what its columns do not depend on linearly, tried on a grid, then more finely.


REFINEMENTS = 2
"""Rounds of trying shapes between the best of a grid and its neighbours."""


@dataclass(frozen=True)
class EffectGroup:
    """Lanes of one effect that share settings."""

    wanted: EffectRequest
    effect: CorrectionEffect
    lanes: tuple[str, ...]
    signals: list[Signals]
    settings: Settings


def best_shape(
    group: EffectGroup,
    rows: Mapping[str, Sequence[np.ndarray]],
    bases: Mapping[str, list[Rows]],
    extra: Mapping[str, list[list[np.ndarray]]],
    *,
    refinements: int = REFINEMENTS,
) -> np.ndarray:
    """(L, P): the best of the effect's grid, then of ``refinements`` finer ones around it."""
    effect, settings = group.effect, group.settings
    grid = effect.shape.grid(group.signals, settings)
    if grid.shape[0] == 1 or grid.shape[2] == 0:
        return grid[0]
    products = {
        name: BaseProducts(
            [
                replace(unit, base=np.column_stack([unit.base, *(parts[u] for parts in extra[name])]))
                for u, unit in enumerate(bases[name])
            ]
        )
        for name in group.lanes
    }
    prior = effect.weights(settings).prior_sd
    units = [list(enumerate(rows[name])) for name in group.lanes]
    fitted = FittedRows.of([len(take) for take in group.signals], units)
    best = np.zeros((len(group.lanes), grid.shape[2]))
    for _ in range(1 + refinements):
        shapes, lanes, numbers = grid.shape
        flat = grid.reshape(shapes * lanes, numbers)
        tiled = [_tiled(take, shapes) for take in group.signals]
        found = FittedColumns.of(effect.dynamics.columns_of_takes(tiled, settings, flat), fitted)
        for lane, name in enumerate(group.lanes):
            best[lane] = grid[held_out(products[name], found.units(lane), prior).shape, lane]
        grid = _finer(grid, best)
    return best


def _tiled(take: Signals, times: int) -> Signals:
    zero = None if take.zero_deg is None else np.tile(take.zero_deg, times)
    return Signals(
        take.time_s,
        np.tile(take.own, (1, times)),
        take.others,
        take.context,
        take.wearing,
        take.take,
        zero,
    )


def _finer(grid: np.ndarray, best: np.ndarray) -> np.ndarray:
    """Shapes between the best and its neighbours in ``grid``, by ratios; (5, L, P)."""
    result = np.empty((5, *best.shape))
    for lane in range(best.shape[0]):
        at = int(
            np.argmin(
                np.abs(np.log(np.maximum(grid[:, lane], 1e-9) / np.maximum(best[lane], 1e-9))).sum(axis=1)
            )
        )
        low, high = grid[max(at - 1, 0), lane], grid[min(at + 1, len(grid) - 1), lane]
        for row, share in enumerate((-2 / 3, -1 / 3, 0.0, 1 / 3, 2 / 3)):
            end = high if share > 0 else low
            result[row, lane] = best[lane] * (np.maximum(end, 1e-9) / np.maximum(best[lane], 1e-9)) ** abs(
                share
            )
    order = np.argsort(result[:, :, :1].mean(axis=(1, 2)))
    return result[order]
