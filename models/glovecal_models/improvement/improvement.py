"""What became of an improvement loop: its steps, every effect that was tried, and why it stopped."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.usable_sensors import UsableSensors
from glovecal_models.ceiling.ceiling import Ceiling
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.diagnosis.actions import Action
from glovecal_models.diagnosis.diagnosis import Diagnosis, Verdict
from glovecal_models.diagnosis.next_take import NextTake, next_take
from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.form_curve import LaneCurves
from glovecal_models.effects.base.signature_effect import SignatureEffect
from glovecal_models.effects.catalogue import catalogue, effect
from glovecal_models.improvement.addition import Addition, ClaimCheck

Stop = Literal["noise_floor", "nothing_named", "ambiguous", "not_better"]


@dataclass(frozen=True)
class AddedInStep:
    """The effect that a step added."""

    effect: str
    where: tuple[str, ...]
    confidence_set: tuple[str, ...]
    """It and all that the takes could not tell from it."""
    parameters: Mapping[str, Any]
    """Learned numbers, units in their names; plain JSON-able data."""
    claim: ClaimCheck | None = None
    next_take: NextTake | None = None
    """The recording that would tell the confidence set apart."""
    associated_with: str | None = None
    """The recorded column that the residual went along with, in words, where that is why it was added."""
    control_share: float | None = None
    """Of the error of its rotations that its control leaves; None where there is none."""
    curves: Mapping[str, LaneCurves] = field(default_factory=dict)
    """For each rotation what its learned form adds over its inputs."""

    @property
    def verdict(self) -> Verdict:
        if self.associated_with is not None:
            return "associated"
        return "named" if len(self.confidence_set) < 2 else "ambiguous"

    @classmethod
    def of(
        cls,
        addition: Addition,
        constants: Settings | None,
        diagnosis: Diagnosis | None,
        confidence_set: tuple[str, ...] = (),
        action: Action | None = None,
    ) -> AddedInStep:
        """``constants``: with which it was added; ``diagnosis``: by which it was chosen, else with
        ``confidence_set`` by its signature."""
        name, known = addition.effect, effect(addition.effect)
        rivals = confidence_set if diagnosis is None else diagnosis.naming.confidence_set
        rivals = rivals if name in rivals else (name,)
        parameters: Mapping[str, Any] = addition.parameters
        if constants is not None and addition.claim is None and isinstance(known, SignatureEffect):
            parameters = known.described_constants(constants)
        following = next_take(rivals, catalogue()) if diagnosis is None else diagnosis.next_take
        following = following if len(rivals) > 1 else None
        where = tuple((constants or {}).get("where", addition.rotations))
        if action is not None:
            phrase = action.association.phrase
            return cls(
                name, where, (name,), parameters, None, None, phrase, addition.control_share, addition.curves
            )
        return cls(
            name, where, rivals, parameters, addition.claim, following, None, addition.control_share,
            addition.curves,
        )  # fmt: skip


@dataclass(frozen=True)
class Step:
    """One model on the way."""

    model: CalibrationModel
    added: AddedInStep | None
    rmse_deg: float
    per_rotation: dict[str, float]
    control_rmse_deg: float | None = None
    """With the effect's control instead: the share it leaves, of the step before."""
    rmse_seen_wearing_deg: float | None = None
    """On held-out takes of the wearings seen in training, also where ``rmse_deg`` is of other takes."""

    @property
    def rmse_unseen_wearing_deg(self) -> float | None:
        """Each wearing left out whole; None: there is only one."""
        found = self.model.unseen_wearing
        return None if found is None else found.rmse_deg


@dataclass(frozen=True)
class Trial:
    """One effect that was tried."""

    addition: Addition
    reasons: tuple[str, ...] = ()
    """Sentences of the effect about what it found in the takes."""
    removed: tuple[str, ...] = ()
    """Earlier effects that it made redundant."""
    diagnosis: Diagnosis | None = None
    """By which it was chosen; None: by its signature."""
    action: Action | None = None
    """The association for which it was tried."""


@dataclass(frozen=True)
class Improvement:
    """The whole loop."""

    steps: tuple[Step, ...]
    noise_floor: dict[str, NoiseFloor]
    stopped: Stop
    diagnosis: Diagnosis | None
    """The last one: what remains, and what to record next."""
    trials: tuple[Trial, ...] = ()
    """In order; those that were undone too."""
    baselines: dict[str, float] = field(default_factory=dict)
    """Errors (deg) of simpler calibrations on the same takes, for scale."""
    take_warnings: tuple[str, ...] = ()
    usable_sensors: UsableSensors | None = None
    only_take_s: float | None = None
    """Length of the only take, where errors are on held-out pieces of it."""
    ceiling: Ceiling | None = None
    """Of the last model; None: not asked for."""

    @property
    def models(self) -> tuple[CalibrationModel, ...]:
        """One for each step."""
        return tuple(step.model for step in self.steps)

    @property
    def undone(self) -> tuple[Addition, ...]:
        return tuple(trial.addition for trial in self.trials if not trial.addition.added)

    @property
    def next_take(self) -> NextTake | None:
        """Of the last diagnosis, else of the last step that was ambiguous."""
        if self.diagnosis is not None and self.diagnosis.next_take is not None:
            return self.diagnosis.next_take
        added = [step.added for step in reversed(self.steps) if step.added is not None]
        return next((item.next_take for item in added if item.verdict == "ambiguous"), None)
