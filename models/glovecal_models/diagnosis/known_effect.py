"""An effect that a model has already: part of the base while another one is looked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from glovecal_models.calibration.added_effect import form_values
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.effects.base.dynamics import ArrayStateEffect
from glovecal_models.effects.base.effect import CorrectionEffect, Effect
from glovecal_models.effects.base.learned_form import FormTerm, LearnedForm
from glovecal_models.effects.base.signals import Settings, Signals


class KnownColumns(NamedTuple):
    """What an effect adds to the base of one joint."""

    parts: list[np.ndarray]
    """For each take (N, C)."""
    prior_sd: np.ndarray
    """(C,) of their weights; infinite for those that the effect always has."""


NOTHING: Mapping[str, list[np.ndarray]] = {}


@dataclass(frozen=True)
class KnownEffect:
    """An effect with its shapes; its constants are settled and its weights fitted anew with the base."""

    effect: Effect
    joints: tuple[str, ...]
    shapes: tuple[np.ndarray, ...]
    """For each joint (P,)."""
    terms: tuple[tuple[FormTerm, ...], ...] = ()
    """For each joint those of its learned form; none given: none was learned."""
    stored: Settings = field(default_factory=dict)
    """Its settings in the model."""
    kept: list[tuple[Sequence[Signals], dict[str, list[np.ndarray]]]] = field(
        default_factory=list, compare=False, repr=False
    )
    """Takes that it was run through, and what came of it."""

    def __getstate__(self) -> dict[str, object]:
        """Workers are sent the effect alone."""
        return {**self.__dict__, "kept": []}

    def side_by_side(self, takes: Sequence[Signals], rotations: Sequence[str]) -> dict[str, list[np.ndarray]]:
        """Its own columns (N, 1, C) of ``takes``, own (N, R), for each of its joints; empty for an effect
        that has no memory of the joint's own signal alone. All joints are run together: a frame costs mostly
        the call, whatever it holds."""
        names = [name for name in self.joints if name in rotations]
        effect = self.effect
        if not isinstance(effect, ArrayStateEffect) or not names:
            return {}
        for known, columns in self.kept:
            if known is takes:
                return columns
        lanes = [rotations.index(name) for name in names]
        some = [replace(take, own=take.own[:, lanes], zero_deg=None) for take in takes]
        settings = self._settings(effect, some)
        shapes = np.array([self.shapes[self.joints.index(name)] for name in names])
        found = effect.dynamics.columns_of_takes(some, settings, shapes)
        columns = {name: [part[:, [at]] for part in found] for at, name in enumerate(names)}
        self.kept.append((takes, columns))
        return columns

    def unsettled(self, takes: Sequence[Signals], lane: int, joint: str) -> list[np.ndarray] | None:
        """For each take (N,): where its unknown start shows in the columns of ``joint``, a lane of ``takes``.
        None where nothing of the joint's motion is remembered."""
        effect = self.effect
        if joint not in self.joints or not isinstance(effect, CorrectionEffect):
            return None
        single = [one_lane(take, lane) for take in takes]
        settings = self._settings(effect, single)
        shape = self.shapes[self.joints.index(joint)][None, :]
        found = [effect.dynamics.unsettled(take, settings, shape) for take in single]
        known = [part[:, 0] for part in found if part is not None]
        return known if len(known) == len(single) else None

    def _settings(self, effect: CorrectionEffect, takes: Sequence[Signals]) -> Settings:
        """Of lanes of ``takes``, with the columns that the model has."""
        settings = effect.further.constants(effect, takes)
        return effect.further.as_stored(takes, settings, self.stored)

    def columns(
        self,
        takes: Sequence[Signals],
        lane: int,
        joint: str,
        together: Mapping[str, list[np.ndarray]] = NOTHING,
    ) -> KnownColumns | None:
        """Of one joint, a lane of ``takes``; None when it is not concerned. ``together``: as
        ``side_by_side`` has it."""
        effect = self.effect
        if joint not in self.joints or not isinstance(effect, CorrectionEffect):
            return None
        place = self.joints.index(joint)
        single = [one_lane(take, lane) for take in takes]
        settings = effect.further.constants(effect, single)
        own_count = len(effect.weights(settings).names)
        settings = effect.further.as_stored(single, settings, self.stored)
        shape = self.shapes[place][None, :]
        plain = together.get(joint) or effect.dynamics.columns_of_takes(single, settings, shape)
        free = np.full(plain[0].shape[2], np.inf)
        free[own_count:] = effect.weights(settings).prior_sd[own_count:]
        terms = self.terms[place] if self.terms else ()
        pairs = zip(single, plain, strict=True)
        values = [form_values(effect, take, part, settings) for take, part in pairs] if terms else []
        terms = tuple(term for term in terms if set(term.inputs) <= set(values[0]))
        if not terms:
            return KnownColumns([part[:, 0, :] for part in plain], free)
        form = LearnedForm.over(terms, values)
        both = [
            np.concatenate([part, form.columns(take)], axis=2)[:, 0, :]
            for part, take in zip(plain, values, strict=True)
        ]
        return KnownColumns(both, np.concatenate([free, np.ones(form.count)]))


def known_effects(model: CalibrationModel) -> tuple[KnownEffect, ...]:
    """One for each effect of a model; those without columns only are not looked for again."""
    found = []
    for item in model.effects:
        active = item.active if item.weights.shape[1] else ()
        shapes = tuple(item.shape[item.rotations.index(name)] for name in active)
        terms = (item.form.terms,) * len(active) if item.form else ()
        found.append(KnownEffect(item.effect, active, shapes, terms, item.settings))
    return tuple(found)


def one_lane(take: Signals, lane: int) -> Signals:
    """The signals of one joint alone."""
    zero = None if take.zero_deg is None else take.zero_deg[[lane]]
    return replace(take, own=take.own[:, [lane]], zero_deg=zero)
