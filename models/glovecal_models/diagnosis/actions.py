"""What to do about a residual that goes along with a recorded column: one command, and what it would save.

The effect that may be behind it is learned in whatever form the takes ask for, and held against its control
with the same form, freedom and choice, both on takes held out whole.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType

import numpy as np

from glovecal_models.diagnosis.candidates import formed_rmse, is_memory_of_known
from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.residual_association import ResidualAssociation
from glovecal_models.effects.base.assessment import HeldOutRmse
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.relations import Whole
from glovecal_models.effects.catalogue import effect, explaining, relations
from glovecal_models.layout import Layout

TRAIN_OTHERWISE = "lmc_gpr"
"""The method that learns curves and products of all the sensors that the layout gives a rotation."""
NOTHING_SAVED: Mapping[str, float] = MappingProxyType({})


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
    least_saved_square: float = 0.0
    """Degrees squared: a physical effect that saves less may only grasp what the form of the model's own
    effects leaves on the rotation."""
    is_of_known: bool = False
    """Whether the model's effects explain it as well by what they are: a memory of what they add, or a part
    of what one of them does."""

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

    @property
    def is_within_known(self) -> bool:
        """Whether what the model's effects leave there may explain as much: no cause is claimed."""
        found = self.rmse_deg
        if not self.is_physical or found is None:
            return False
        return self.is_of_known or found.before**2 - found.after**2 < self.least_saved_square

    @property
    def saved_share(self) -> float | None:
        """Of the squared error, beyond what the control saves."""
        found = self.rmse_deg
        if found is None or found.before <= 0:
            return None
        return (min(found.before, found.control) ** 2 - found.after**2) / found.before**2


def together(actions: Sequence[Action]) -> HeldOutRmse:
    """Errors of several actions, each on its rotation, as one root mean square."""
    found = [item.rmse_deg for item in actions if item.rmse_deg is not None]
    before, after, control = (
        float(np.sqrt(np.mean([getattr(item, part) ** 2 for item in found]))) if found else 0.0
        for part in ("before", "after", "control")
    )
    return HeldOutRmse(before, after, control)


def actions_for(
    associations: Sequence[ResidualAssociation],
    design: ForwardDesign,
    layout: Layout,
    has: Set[tuple[str, str]],
    *,
    linear: bool,
    seed: int = 0,
    saved_by_known: Mapping[str, float] = NOTHING_SAVED,
    wholes: Sequence[Whole] = (),
    own: Sequence[Effect] = (),
) -> tuple[Action, ...]:
    """One for each rotation and effect, those that save most first. ``has``: effects that are on a rotation
    already, as pairs; ``linear``: whether the base is a straight line of the measuring sensor;
    ``saved_by_known``: degrees squared that the model's effects save on each rotation; ``wholes``: those of
    its effects that others seem to explain a part of; ``own``: effects that the user declared."""
    found: list[Action] = []
    done: set[tuple[str, str]] = set()
    for item in associations:
        action = _action(item, design, layout, has, linear, seed, own)
        least = design.limits.beside_known_share * saved_by_known.get(item.rotation, 0.0)
        is_of_known = _is_of_known(action, design, wholes, own)
        action = replace(action, least_saved_square=least, is_of_known=is_of_known)
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
    own: Sequence[Effect],
) -> Action:
    sensor = _sensor_of(item.column, layout)
    if linear and sensor is not None and sensor in layout.correspondence(item.rotation).sensors:
        return Action(item, None, method=TRAIN_OTHERWISE)
    best, of_the_base = Action(item, None), dict(relations().of_the_base)
    for each in explaining(item.column, sensor, own):
        # A column that only has a name comes last: it is taken where no physical effect saves anything.
        if (each.name, item.rotation) in has or (best.saves and not each.about.is_physical):
            continue
        work = partial(formed_rmse, design, each, design.rotations.index(item.rotation), seed)
        rmse = design.once(f"{each.name} in a form on {item.rotation}", work)
        if rmse is None:
            continue
        method = of_the_base.get(each.name) if linear else None
        tried = Action(item, each.name, each.about.is_physical, method, rmse)
        if tried.saves and (not best.saves or _saved(tried) > _saved(best)):
            best = tried
    return best


def _is_of_known(
    action: Action, design: ForwardDesign, wholes: Sequence[Whole], own: Sequence[Effect]
) -> bool:
    if action.effect is None or not action.saves:
        return False
    share = action.saved_share or 0.0
    if any(action.effect in each.parts and share < each.share for each in wholes):
        return True
    asked = next((item for item in own if item.name == action.effect), None) or effect(action.effect)
    return is_memory_of_known(design, asked, design.rotations.index(action.rotation))


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
