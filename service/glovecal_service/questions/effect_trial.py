"""What one effect would save of a model's held-out error: the diagnosis with this effect alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from glovecal_models.calibration.artifact import load
from glovecal_models.calibration.training_settings import effect_named
from glovecal_models.diagnosis.model_on_takes import ModelOnTakes
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.catalogue import effect_of_declaration
from glovecal_models.takes.take import Take


@dataclass(frozen=True)
class EffectTrial:
    """As plain data, so that a process of its own can do it."""

    artifact: bytes
    """The model's."""
    takes: Sequence[Take]
    """Each is left out once."""
    effect: str
    declaration: Mapping[str, Any] | None
    """Of an effect that is not in the catalogue."""


class TrialResult(NamedTuple):
    judged: Assessment | None
    not_identifiable: str | None
    """Why these takes cannot show it."""


def try_effect(trial: EffectTrial) -> TrialResult:
    """Raises BadInput, NotTrainable."""
    model = load(trial.artifact)
    own = [] if trial.declaration is None else [effect_of_declaration(trial.declaration)]
    asked = own[0] if own else effect_named(model, trial.effect)
    found = ModelOnTakes.of(model, trial.takes, own).diagnosed(
        effects=[asked], signatures=False, judge_residual=False, noise_floors={}
    )
    judged = next((item for item in found.assessments if item.effect == asked.name), None)
    why = next((item.why for item in found.not_identifiable if item.effect == asked.name), None)
    return TrialResult(judged, why)
