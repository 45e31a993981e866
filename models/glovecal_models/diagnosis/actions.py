"""What to do about a residual that goes along with a recorded column: one command, and what it would save.

The effect that may be behind it is learned in whatever form the takes ask for, and held against its control
with the same form, freedom and choice, both on takes held out whole.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.calibration.added_effect import form_values
from glovecal_models.calibration.form_choice import EVERY as FORM_EVERY
from glovecal_models.calibration.form_choice import FormRows, chosen_form
from glovecal_models.calibration.held_out import BaseProducts, Rows
from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.known_effect import one_lane
from glovecal_models.diagnosis.residual_association import ResidualAssociation
from glovecal_models.effects.base.assessment import HeldOutRmse
from glovecal_models.effects.base.control import control_signals
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.learned_form import LearnedForm
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.catalogue import explaining
from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout

FOLDS = 4
TRAIN_OTHERWISE = "lmc_gpr"
"""The method that learns curves and products of all the sensors that the layout gives a rotation."""


@dataclass(frozen=True)
class Action:
    """What one association asks for."""

    association: ResidualAssociation
    effect: str | None
    """To be added on the association's rotation; None where only ``method`` helps, or nothing is known."""
    is_physical: bool = True
    """Whether the effect's name says what happens; else it only names the column."""
    method: str | None = None
    """To be trained with rather, where the base could read the column and a straight line does not use it."""
    rmse_deg: HeldOutRmse | None = None
    """Of the rotation's sensor, on takes held out whole: without the effect, with it, with its control."""

    @property
    def rotation(self) -> str:
        return self.association.rotation

    @property
    def control_share(self) -> float | None:
        """Of the error that the control leaves, at most 1."""
        found = self.rmse_deg
        return None if found is None or found.before <= 0 else min(found.control / found.before, 1.0)

    @property
    def saves(self) -> bool:
        """Whether the effect beats nothing and its control on held-out takes."""
        found = self.rmse_deg
        return found is not None and found.after < min(found.before, found.control)


def actions_for(
    associations: Sequence[ResidualAssociation],
    design: ForwardDesign,
    layout: Layout,
    has: Set[tuple[str, str]],
    *,
    linear: bool,
    seed: int = 0,
) -> tuple[Action, ...]:
    """One for each rotation and effect, those that save most first. ``has``: effects that are on a rotation
    already, as pairs; ``linear``: whether the base is a straight line of the measuring sensor."""
    found: list[Action] = []
    done: set[tuple[str, str]] = set()
    for item in associations:
        action = _action(item, design, layout, has, linear, seed)
        key = (item.rotation, action.effect or action.method or item.column)
        if key not in done:
            done.add(key)
            found.append(action)
    return tuple(sorted(found, key=lambda each: (not each.saves, -_saved(each))))


def _action(
    item: ResidualAssociation,
    design: ForwardDesign,
    layout: Layout,
    has: Set[tuple[str, str]],
    linear: bool,
    seed: int,
) -> Action:
    sensor = _sensor_of(item.column, layout)
    if linear and sensor is not None and sensor in layout.correspondence(item.rotation).sensors:
        return Action(item, None, method=TRAIN_OTHERWISE)
    best = Action(item, None)
    for effect in explaining(item.column, sensor):
        if (effect.name, item.rotation) in has:
            continue
        rmse = formed_rmse(design, effect, design.rotations.index(item.rotation), seed)
        if rmse is None:
            continue
        method = effect.learned_by if linear else None
        tried = Action(item, effect.name, effect.is_physical, method, rmse)
        # A column that only has a name comes last: it is taken where no physical effect saves anything.
        if tried.saves and (not best.saves or (effect.is_physical and _saved(tried) > _saved(best))):
            best = tried
    return best


def _saved(action: Action) -> float:
    found = action.rmse_deg
    return 0.0 if found is None else found.before - found.after


def _sensor_of(column: str, layout: Layout) -> str | None:
    """The sensor that tells of a column: itself, or the one that measures the joint."""
    kind, _, name = column.partition(" ")
    if kind == "sensor":
        return name
    if column == "angle" or kind != "joint" or name not in layout.rotations:
        return None
    return layout.correspondence(name).measuring_sensor


@dataclass(frozen=True)
class _Inputs:
    """An effect's own columns on one joint, and what its form may be a function of."""

    plain: list[np.ndarray]
    """For each unit (N, C)."""
    values: list[Mapping[str, np.ndarray]]
    """For each unit, each (N, 1)."""


def formed_rmse(design: ForwardDesign, effect: Effect, joint: int, seed: int = 0) -> HeldOutRmse | None:
    """Held-out errors of one joint's sensor, degrees; None where these takes cannot show the effect."""
    signals = [
        one_lane(
            replace(take, others={k: v for k, v in take.others.items() if k not in design.known[joint]}),
            joint,
        )
        for take in design.signals
    ]
    if effect.not_applicable_reason(signals) is not None:
        return None
    settings = effect.fit_constants(signals)
    grid = effect.grid(signals, settings)
    shape = grid[len(grid) // 2]
    try:
        wrong = control_signals(effect, signals, np.random.default_rng(seed))
    except BadInput:
        return None
    step = -1 if effect.control == "time-reversed" else 1
    right = _inputs(design, joint, effect, signals, settings, shape, 1)
    control = _inputs(design, joint, effect, wrong, settings, shape, step)
    prior = effect.prior_sd(settings)
    squares, count = np.zeros(3), 0
    for held in _folds(design):
        base = _errors(design, joint, held, None, prior)
        squares += [
            base,
            _errors(design, joint, held, right, prior),
            _errors(design, joint, held, control, prior),
        ]
        count += sum(len(design.products[joint].units[unit].target) for unit in held)
    return HeldOutRmse(*(float(np.sqrt(square / max(count, 1))) for square in squares))


def _folds(design: ForwardDesign) -> list[list[int]]:
    """Units held out together: whole takes."""
    takes = list(dict.fromkeys(design.unit_take))
    parts = min(FOLDS, len(takes)) if len(takes) > 1 else min(FOLDS, len(design.unit_take))
    of = takes if len(takes) > 1 else list(range(len(design.unit_take)))
    number = {item: at % parts for at, item in enumerate(of)}
    which = [number[take] if len(takes) > 1 else number[unit] for unit, take in enumerate(design.unit_take)]
    return [[unit for unit, fold in enumerate(which) if fold == at] for at in range(parts)]


def _inputs(
    design: ForwardDesign,
    joint: int,
    effect: Effect,
    signals: Sequence[Signals],
    settings: Settings,
    shape: np.ndarray,
    step: int,
) -> _Inputs:
    plain = [effect.columns(take, settings, shape) for take in signals]
    values = [form_values(effect, take, part, settings) for take, part in zip(signals, plain, strict=True)]
    units = list(design.units(joint))
    return _Inputs(
        [plain[take][::step][index, 0] for take, index in units],
        [{name: each[::step][index] for name, each in values[take].items()} for take, index in units],
    )


def _errors(
    design: ForwardDesign, joint: int, held: Sequence[int], inputs: _Inputs | None, prior_sd: np.ndarray
) -> float:
    """Sum of squares, degrees squared, on the units of ``held``; the form is chosen on the others."""
    products = design.products[joint]
    units = products.units
    kept = [unit for unit in range(len(units)) if unit not in held]
    extra: list[np.ndarray] = [np.empty((len(unit.target), 0)) for unit in units]
    sd = np.full(units[0].base.shape[1], np.inf)
    if inputs is not None:
        extra, sd = inputs.plain, np.concatenate([sd, prior_sd])
        terms = chosen_form([_form_rows(units, kept, inputs, prior_sd)]) if inputs.values[0] else ()
        if terms:
            form = LearnedForm.over(terms, [inputs.values[unit] for unit in kept])
            learned = [form.columns(values)[:, 0, :] for values in inputs.values]
            extra = [np.column_stack(pair) for pair in zip(extra, learned, strict=True)]
            sd = np.concatenate([sd, np.ones(form.count)])
    rows = [
        Rows(np.column_stack([unit.base, part]), unit.target) for unit, part in zip(units, extra, strict=True)
    ]
    fitted = BaseProducts([rows[unit] for unit in kept], sd)
    left = [rows[unit].target - fitted.fitted(rows[unit].base) for unit in held]
    return float(sum(part @ part for part in left))


def _form_rows(units: Sequence[Rows], kept: Sequence[int], inputs: _Inputs, prior_sd: np.ndarray) -> FormRows:
    some = slice(None, None, FORM_EVERY)
    return FormRows(
        np.concatenate([units[unit].base[some] for unit in kept]),
        np.concatenate([inputs.plain[unit][some] for unit in kept]),
        prior_sd,
        {
            name: np.concatenate([inputs.values[unit][name][some] for unit in kept])
            for name in inputs.values[0]
        },
        np.concatenate([units[unit].target[some] for unit in kept]),
    )
