"""An effect of a calibration model: on which rotations, in which form, with which shape and weights.

An effect that a calibration is asked to have, and where.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from glovecal_models.effects.base.effect import (
    CorrectionEffect,
    Effect,
    FormSignals,
    IntervalEffect,
    RepairEffect,
    Stream,
    described,
)
from glovecal_models.effects.base.facts import WeightsOfWearings
from glovecal_models.effects.base.form_curve import LaneCurves
from glovecal_models.effects.base.learned_form import OWN, LearnedForm
from glovecal_models.effects.base.signals import GloveFrames, Settings, Signals
from glovecal_models.effects.catalogue import stored_correction, stored_effect
from glovecal_models.errors import BadInput

FORM = "form"
"""Where settings keep the learned form; without one the effect's own columns are all."""
CURVES = "curves"
"""Where the form's document keeps, for each rotation, what it adds over its inputs."""
FORM_FRAMES_AT_ONCE = 2048


class Contribution(NamedTuple):
    """What one effect adds on its lanes."""

    degrees: np.ndarray
    """(N, L)."""
    variance: np.ndarray | None
    """(N, L), degrees squared, of its weights; None where the model does not hold their covariance."""


@dataclass(frozen=True)
class AddedEffect:
    """Immutable. The correction is columns x weights, added to the base's prediction."""

    name: str
    rotations: tuple[str, ...]
    """The L lanes."""
    settings: Settings
    shape: np.ndarray
    """(L, P)."""
    weights: np.ndarray
    """(L, C); the effect's own columns first, then those of its learned form. No columns for an effect that
    repairs the reference."""
    zero_deg: np.ndarray
    """(L,): the base's prediction at a raw reading of zero, by a straight line."""
    evidence: Mapping[str, Any] = field(default_factory=dict)
    """What it saved, beside its control, when it was added; plain JSON-able data."""
    covariance: np.ndarray | None = None
    """(L, C, C) of the weights; None in models that were stored without."""

    def __post_init__(self) -> None:
        lanes = len(self.rotations)
        if self.shape.ndim != 2 or len(self.shape) != lanes or self.weights.ndim != 2:
            raise BadInput(f"effect {self.name!r}: shape {self.shape.shape} for {lanes} rotations")
        if len(self.weights) != lanes or self.zero_deg.shape != (lanes,):
            raise BadInput(f"effect {self.name!r}: weights {self.weights.shape} for {lanes} rotations")
        expected = (*self.weights.shape, self.weights.shape[1])
        if self.covariance is not None and self.covariance.shape != expected:
            raise BadInput(
                f"effect {self.name!r}: covariance {self.covariance.shape} of weights {self.weights.shape}"
            )

    @property
    def effect(self) -> Effect:
        """From the catalogue. Raises BadInput when this machine does not have it."""
        return stored_effect(self.name, self.settings)

    @property
    def correction(self) -> CorrectionEffect:
        """The same, of an effect with columns. Raises BadInput as above, and for any other."""
        return stored_correction(self.name, self.settings)

    @property
    def of_wearings(self) -> WeightsOfWearings | None:
        """What its weights tell of single wearings; None where they are the same in all. Raises BadInput."""
        effect = self.effect
        return effect.weights(self.settings).of_wearings if isinstance(effect, CorrectionEffect) else None

    @cached_property
    def form(self) -> LearnedForm | None:
        """What was learned of how its inputs act, beyond its own columns. Raises BadInput."""
        return LearnedForm.from_document(self.settings[FORM]) if FORM in self.settings else None

    @cached_property
    def curves(self) -> dict[str, LaneCurves]:
        """What it added in training over each input of its learned form, of every rotation on which it has
        weight; empty without a form, and in models that were stored without. Raises BadInput."""
        stored = self.settings.get(FORM, {}).get(CURVES, {})
        return {name: LaneCurves.from_document(stored[name]) for name in self.active if name in stored}

    @property
    def own_count(self) -> int:
        """Columns that are not of the learned form."""
        return self.weights.shape[1] - (self.form.count if self.form else 0)

    @property
    def active(self) -> tuple[str, ...]:
        """Rotations on which it has weight."""
        if not self.weights.shape[1]:
            return self.rotations
        return tuple(
            name for name, weights in zip(self.rotations, self.weights, strict=True) if np.any(weights)
        )

    @property
    def transient_s(self) -> float:
        """How long a state started anew still shows, seconds; 0 without a memory."""
        effect = self.effect
        if not isinstance(effect, CorrectionEffect):
            return 0.0
        return effect.dynamics.transient_s(self.shape[self.weights.any(axis=1)], self.settings)

    def described(self) -> dict[str, dict[str, float]]:
        """For each rotation the learned numbers, units in their names."""
        effect = self.effect
        if isinstance(effect, IntervalEffect):
            return {name: effect.described_on(self.settings, name) for name in self.rotations}
        if not isinstance(effect, CorrectionEffect):
            return {name: {} for name in self.rotations}
        own = self.own_count
        return {
            name: self._with_curves(name, described(effect, self.settings, shape, weights[:own]))
            for name, shape, weights in zip(self.rotations, self.shape, self.weights, strict=True)
            if name in self.active
        }

    def _with_curves(self, rotation: str, numbers: Mapping[str, float]) -> dict[str, float]:
        """The shape's numbers, those of the form's curves, then the weights."""
        if rotation not in self.curves:
            return dict(numbers)
        each, first = list(numbers.items()), len(self.effect.shape.parameters)
        return {**dict(each[:first]), **self.curves[rotation].described(), **dict(each[first:])}

    def columns_of_takes(self, takes: Sequence[Signals]) -> list[np.ndarray]:
        """(N, L, C) of each take whose lanes are this effect's: what the weights are multiplied with."""
        effect = self.correction
        found = effect.dynamics.columns_of_takes(takes, self.settings, self.shape)
        if self.form is None:
            return found
        inputs = [
            form_values(effect, take, part, self.settings) for take, part in zip(takes, found, strict=True)
        ]
        return [
            np.concatenate([part, self.form.columns(values)], axis=2)
            for part, values in zip(found, inputs, strict=True)
        ]

    def corrections(self, takes: Sequence[Signals]) -> list[np.ndarray]:
        """(N, L), degrees, of each take whose lanes are this effect's."""
        found = self.correction.dynamics.columns_of_takes(takes, self.settings, self.shape)
        return [self._contribution(take, part, None).degrees for take, part in zip(takes, found, strict=True)]

    def contribution(self, take: Signals) -> Contribution:
        """To every frame of a take whose lanes are this effect's."""
        plain = self.correction.columns(take, self.settings, self.shape)
        return self._contribution(take, plain, self.variance_factor)

    def _contribution(self, take: Signals, plain: np.ndarray, factor: np.ndarray | None) -> Contribution:
        """Of the effect's own columns ``plain`` (N, L, C); without ``factor`` no variance."""
        if self.form is None and factor is None:
            return Contribution(np.einsum("nlc,lc->nl", plain, self.weights), None)
        inputs = form_values(self.correction, take, plain, self.settings) if self.form else {}
        degrees = np.empty(plain.shape[:2])
        variance = None if factor is None else np.empty(plain.shape[:2])
        for first in range(0, len(take), FORM_FRAMES_AT_ONCE):
            rows = slice(first, first + FORM_FRAMES_AT_ONCE)
            columns = plain[rows]
            if self.form is not None:
                learned = self.form.columns({name: values[rows] for name, values in inputs.items()})
                columns = np.concatenate([columns, learned], axis=2)
            degrees[rows] = np.einsum("nlc,lc->nl", columns, self.weights)
            if variance is not None and factor is not None:
                variance[rows] = weight_variance(columns, factor)
        return Contribution(degrees, variance)

    @cached_property
    def variance_factor(self) -> np.ndarray | None:
        """(L, C, C): the covariance of the weights is this times its transpose. None where it is not held."""
        if self.covariance is None or not self.covariance.size:
            return None
        if self.of_wearings is not None:
            return None  # they tell all that is unknown of them
        values, vectors = np.linalg.eigh(self.covariance)
        return vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]

    def stream(self) -> Stream:
        """All its columns, frame by frame."""
        effect = self.correction
        inner = effect.dynamics.stream(self.settings, self.shape)
        return inner if self.form is None else _FormedStream(effect, self.form, inner, self.settings)


def weight_variance(columns: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """(N, L), degrees squared: of ``columns`` (N, L, C) with weights of covariance ``factor`` (L, C, C)."""
    spread = np.matmul(columns.transpose(1, 0, 2), factor)
    return np.einsum("lnc,lnc->nl", spread, spread)


def form_values(
    effect: CorrectionEffect, take: Signals, columns: np.ndarray, settings: Settings
) -> FormSignals:
    """(N, L) of every input of a learned form by name; empty for an effect that has none."""
    found = effect.form_inputs(take, columns, settings)
    return FormSignals({OWN: take.own, **found}, found.unit, found.take_sd_deg) if found else found


class _FormedStream(Stream):
    """An effect's columns and those of its learned form."""

    def __init__(
        self, effect: CorrectionEffect, form: LearnedForm, inner: Stream, settings: Settings
    ) -> None:
        self._effect, self._form, self._inner, self._settings = effect, form, inner, settings

    @property
    def undefined(self) -> str | None:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self._inner.undefined

    def columns(self, frame: Signals) -> np.ndarray:
        return self._with_form(frame, self._inner.columns(frame))

    def reset(self) -> None:
        self._inner.reset()

    def _with_form(self, frame: Signals, plain: np.ndarray) -> np.ndarray:
        inputs = form_values(self._effect, frame, plain, self._settings)
        return np.concatenate([plain, self._form.columns(inputs)], axis=2)

    @classmethod
    def together(cls, streams: Sequence[Any], frames: GloveFrames) -> np.ndarray:
        inner = [stream._inner for stream in streams]
        plain = type(inner[0]).together(inner, frames)
        signals = frames.as_one()
        if signals is not None:
            return streams[0]._with_form(signals, plain)
        each = zip(streams, frames, plain, strict=True)
        return np.concatenate([stream._with_form(frame, part[None]) for stream, frame, part in each])


@dataclass(frozen=True)
class EffectRequest:
    """An effect and the rotations it is on."""

    effect: Effect
    rotations: tuple[str, ...]
    settings: Settings = field(default_factory=dict)
    """What is known already: the clocks' offsets."""

    @property
    def name(self) -> str:
        return self.effect.name

    @property
    def has_columns(self) -> bool:
        """It corrects the prediction; the others repair the measurement or widen the interval."""
        return isinstance(self.effect, CorrectionEffect)

    @property
    def correction(self) -> CorrectionEffect:
        """The effect, where it has columns."""
        assert isinstance(self.effect, CorrectionEffect), f"{self.name} has no columns"
        return self.effect

    @property
    def is_on_reference(self) -> bool:
        """It repairs the measurement; nothing is predicted."""
        return isinstance(self.effect, RepairEffect)


def columnless_effects(
    wanted: Sequence[EffectRequest], before: Sequence[AddedEffect] = ()
) -> list[AddedEffect]:
    """The effects among ``wanted`` that have settings only: repairs of the measurement, wider intervals.

    Those there were ``before`` keep their evidence.
    """
    evidence = {item.name: item.evidence for item in before}
    found = []
    for item in wanted:
        if not item.has_columns:
            nothing = np.zeros((len(item.rotations), 0))
            zero = np.zeros(len(item.rotations))
            known = evidence.get(item.name, {})
            found.append(AddedEffect(item.name, item.rotations, item.settings, nothing, nothing, zero, known))
    return found
