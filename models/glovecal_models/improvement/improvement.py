"""What became of an improvement loop: its steps, every effect that was tried, and why it stopped.

Errors of the models of an improvement, beside simpler calibrations and the noise floor; why it stopped.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from glovecal_models.calibration.leave_out import HeldOutErrors, held_out_errors
from glovecal_models.calibration.methods import Method
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_plan import UsableSensors
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.ceiling.ceiling import Ceiling
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.noise_floor import is_at_floor as is_one_at_floor
from glovecal_models.comparison.residuals import residuals
from glovecal_models.diagnosis.actions import Action
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.next_take import next_take
from glovecal_models.diagnosis.residual_answer import NextTake
from glovecal_models.effects.base.effect import RepairEffect
from glovecal_models.effects.base.signals import Settings
from glovecal_models.effects.catalogue import catalogue, effect
from glovecal_models.improvement.addition import Addition
from glovecal_models.improvement.answer import AddedInStep
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

Stop = Literal["noise_floor", "nothing_named", "ambiguous", "not_better"]
SIMPLER: tuple[Method, ...] = ("raw", "linear")


def added_in_step(
    addition: Addition,
    constants: Settings | None,
    diagnosis: Diagnosis | None,
    confidence_set: tuple[str, ...] = (),
    action: Action | None = None,
) -> AddedInStep:
    """``constants``: with which it was added; ``diagnosis``: by which it was chosen, else with
    ``confidence_set`` by its signature; ``action``: the association for which it was tried."""
    name, known = addition.effect, effect(addition.effect)
    rivals = confidence_set if diagnosis is None else diagnosis.naming.confidence_set
    rivals = rivals if name in rivals and action is None else (name,)
    parameters: Mapping[str, Any] = addition.parameters
    if constants is not None and addition.claim is None and isinstance(known, RepairEffect):
        parameters = known.described(constants)
    following = next_take(rivals, catalogue()) if diagnosis is None else diagnosis.next_take
    return AddedInStep(
        name,
        tuple((constants or {}).get("where", addition.rotations)),
        rivals,
        parameters,
        None if action is not None else addition.claim,
        following if len(rivals) > 1 else None,
        None if action is None else action.association.phrase,
        addition.control_share,
        addition.curves,
    )


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


def step_errors(
    model: CalibrationModel, holdout: Sequence[Take], held_out: HeldOutErrors
) -> tuple[dict[str, float], float]:
    """RMSE, degrees, of each rotation and overall: on ``holdout`` when there is one, else ``held_out``."""
    if not holdout:
        return {name: held_out.rmse_deg(name) for name in held_out.square}, held_out.overall_deg
    found = residuals(model, holdout)
    error = found.stacked("error")
    each = {
        name: float(np.sqrt(np.nanmean(error[:, found.column(name)] ** 2)))
        for name in found.measured_rotations
    }
    return each, float(np.sqrt(np.nanmean(error**2)))


def is_at_floor(
    rmse_deg: Mapping[str, float],
    floors: Mapping[str, NoiseFloor],
    limits: ComparisonLimits = COMPARISON_LIMITS,
) -> bool:
    """Whether every rotation whose floor is known is at it; False when none is."""
    pairs = [(rmse_deg[name], floor) for name, floor in floors.items() if name in rmse_deg]
    return bool(pairs) and all(is_one_at_floor(error, floor, limits) for error, floor in pairs)


def baselines(
    takes: Sequence[Take],
    layout: Layout,
    rotations: Sequence[str],
    settings: TrainingSettings,
    holdout: Sequence[Take],
) -> dict[str, float]:
    """RMSE in degrees by method, on ``holdout`` or, without one, on held-out takes."""
    found: dict[str, float] = {}
    for method in SIMPLER:
        if method == settings.method:
            continue
        if holdout:
            model = train(takes, layout, "baseline", TrainingSettings(method=method, folds=0))
            error = residuals(model, holdout).stacked("error")
            found[method] = float(np.sqrt(np.nanmean(error**2)))
        else:
            plain = TrainingSettings(method=method, folds=settings.folds)
            prepared = PreparedTakes.of(takes, layout)
            found[method] = held_out_errors(prepared, rotations, [], plain).overall_deg
    return found


def why_stopped(
    stopped: Stop,
    steps: Sequence[Step],
    floors: Mapping[str, NoiseFloor],
    diagnosis: Diagnosis | None,
    limits: ComparisonLimits = COMPARISON_LIMITS,
) -> Stop:
    """``stopped`` so far ("nothing_named" or "not_better"), or what is known better of the end."""
    held = diagnosis.hold_drift if diagnosis else None
    if held is not None:
        return "ambiguous" if len(held.confidence_set) > 1 else "nothing_named"
    # Errors against a wrong reference, and their floor, mean nothing.
    doubtful = diagnosis is not None and bool(diagnosis.reference_problems)
    if not doubtful and is_at_floor(steps[-1].per_rotation, floors, limits):
        return "noise_floor"
    added = [step.added for step in steps if step.added is not None]
    undecided = diagnosis is not None and len(diagnosis.naming.confidence_set) > 1
    if (added and added[-1].verdict == "ambiguous") or (stopped == "nothing_named" and undecided):
        return "ambiguous"
    return stopped
