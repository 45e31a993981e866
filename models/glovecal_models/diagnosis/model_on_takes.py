"""A model at work on takes: what every question of the two begins with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from glovecal_models.calibration.methods import LINEAR_METHODS
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training_settings import declared_effects, repaired_takes, requested_effects
from glovecal_models.comparison.like_postures import OddTake
from glovecal_models.comparison.noise_floor import rotation_noise
from glovecal_models.comparison.odd_takes import fitting, odd_takes
from glovecal_models.comparison.residuals import residuals
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.known_effect import KnownEffect, known_effects
from glovecal_models.effects.base.effect import Effect
from glovecal_models.layout import Layout
from glovecal_models.progress import Cancel, Report
from glovecal_models.takes.channel_faults import session_faults
from glovecal_models.takes.take import Take


@dataclass(frozen=True)
class ModelOnTakes:
    """Takes as a model reads them, with what is known of them already. Without a model only takes and layout
    are given."""

    takes: tuple[Take, ...]
    """Repaired as the model's effects ask for: clocks on the frames' time, faulty pieces left out."""
    layout: Layout
    linear: bool = False
    """Whether the base is a straight line of the measuring sensor."""
    known: tuple[KnownEffect, ...] = ()
    """Effects that the model has, where they act."""
    own: tuple[Effect, ...] = ()
    """Effects that a user declared: the model's, and those that are asked for beside it."""

    @classmethod
    def of(cls, model: CalibrationModel, takes: Sequence[Take], own: Sequence[Effect] = ()) -> ModelOnTakes:
        """``own``: declared beside the model's; one of the same name counts instead of the model's."""
        return cls.of_repaired(model, repaired_takes(takes, requested_effects(model)), own)

    @classmethod
    def of_repaired(
        cls, model: CalibrationModel, takes: Sequence[Take], own: Sequence[Effect] = ()
    ) -> ModelOnTakes:
        """Of takes that were repaired before."""
        every = {item.name: item for item in (*declared_effects(model), *own)}
        return cls(
            tuple(takes),
            model.layout,
            model.method in LINEAR_METHODS,
            known_effects(model),
            tuple(every.values()),
        )

    def without(self, *names: str) -> ModelOnTakes:
        """As if the model had no effects of these names; the takes stay as they were repaired."""
        return replace(self, known=tuple(item for item in self.known if item.effect.name not in names))

    def diagnosed(self, **choices: Any) -> Diagnosis:
        """What readings show by themselves comes first: rotations are read from other sensors where there are
        any. ``choices`` as of ``diagnose``. Raises BadInput, Cancelled."""
        faults = session_faults(self.takes, self.layout.sensors)
        layout = self.layout.read_without({name for _, fault in faults for name in fault.channels})
        choices |= {"linear": self.linear, "known": self.known, "own": self.own}
        return replace(diagnose(self.takes, layout, **choices), sensor_faults=faults)


@dataclass(frozen=True)
class DiagnosedModel:
    """What is missing in a model, and which of the takes did not fit the others."""

    diagnosis: Diagnosis
    odd: tuple[OddTake, ...]
    """Those that are set aside were not diagnosed."""


def diagnose_model(
    model: CalibrationModel,
    takes: Sequence[Take],
    *,
    own: Sequence[Effect] = (),
    seed: int = 0,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> DiagnosedModel:
    """Hold the takes against each other, measure their noise floors, and diagnose those that fit.

    ``own``: effects that a user declared beside the model's; ``seed`` of the controls. Raises BadInput,
    Cancelled.
    """
    say = report or (lambda sentence, share: None)
    say("holding the takes against each other", 0.0)
    odd = odd_takes(takes, model.layout)
    takes = fitting(takes, odd)
    say("measuring the noise floors", 0.0)
    noise = rotation_noise(residuals(model, takes))
    found = ModelOnTakes.of(model, takes, own).diagnosed(
        noise_floors={name: item.floor for name, item in noise.items() if item.floor is not None},
        seed=seed,
        cancelled=cancelled,
        report=report,
    )
    return DiagnosedModel(found, tuple(odd))
