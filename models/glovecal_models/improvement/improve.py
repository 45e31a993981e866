"""The loop: diagnose, add, verify, until the noise floor is reached or nothing more can be named."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from glovecal_models.calibration.effect_fit import optima_of
from glovecal_models.calibration.leave_out import HeldOutErrors, held_out_errors, left_out_wearings
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training import noise_of, train
from glovecal_models.calibration.training_plan import UsableSensors, usable_sensors
from glovecal_models.calibration.training_settings import (
    TrainingSettings,
    repaired_takes,
    requested_effects,
    settings_of,
    trained_rotations,
)
from glovecal_models.calibration.unseen_wearing import LeftOutWearing, unseen_wearing
from glovecal_models.ceiling.black_box_ceiling import black_box_ceiling
from glovecal_models.ceiling.ceiling import Ceiling
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.like_postures import OddTake
from glovecal_models.comparison.noise_floor import noise_floors
from glovecal_models.comparison.odd_takes import fitting, odd_takes
from glovecal_models.comparison.residuals import residuals
from glovecal_models.diagnosis.actions import Action
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.model_on_takes import ModelOnTakes
from glovecal_models.diagnosis.text import remedy
from glovecal_models.effects.base.effect import RepairEffect, is_asked_last
from glovecal_models.effects.base.findings import FoundBefore
from glovecal_models.effects.catalogue import catalogue, effect
from glovecal_models.improvement.add_effect import Proposed, add_effect, repairs, widenings
from glovecal_models.improvement.addition import share_in
from glovecal_models.improvement.answer import AddedInStep
from glovecal_models.improvement.improvement import (
    Improvement,
    Step,
    Stop,
    Trial,
    added_in_step,
    baselines,
    step_errors,
    why_stopped,
)
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits
from glovecal_models.improvement.remove_effect import without_redundant
from glovecal_models.layout import Layout
from glovecal_models.progress import Cancel, Report, part
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import take_warnings
from glovecal_models.worker_processes import shared_workers

Stepped = Callable[[Sequence[Step]], None]


def improve(
    takes: Sequence[Take],
    layout: Layout,
    subject: str,
    settings: TrainingSettings | None = None,
    *,
    holdout: Sequence[Take] = (),
    max_steps: int = 6,
    seed: int = 0,
    take_hashes: Sequence[str] = (),
    limits: ImprovementLimits = IMPROVEMENT_LIMITS,
    ceiling: bool = False,
    workers: int = 1,
    cancelled: Cancel | None = None,
    report: Report | None = None,
    stepped: Stepped | None = None,
) -> Improvement:
    """Train, then add what the diagnosis names while it pays. Raises NotTrainable, BadInput, Cancelled,
    WorkerDied.

    Takes that do not fit the others are set aside first. Errors are on ``holdout`` when given, else on
    held-out takes. ``ceiling``: see at the end whether anything is left to gain from what was recorded; needs
    the extra ``ceiling`` of this package. ``workers``: processes for what can be worked out side by side; the
    result is the same whatever their number. ``stepped`` is given all steps so far after each.
    """
    settings = settings or TrainingSettings()
    odd = odd_takes(takes, layout)
    if len(take_hashes) == len(takes):
        take_hashes = fitting(take_hashes, odd)
    takes, usable = fitting(takes, odd), usable_sensors(layout, fitting(takes, odd))
    with shared_workers(workers, "the improvement", cancelled) as stopped:
        loop = _Loop(
            takes, usable, odd, subject, settings, tuple(holdout), seed, tuple(take_hashes), limits,
            stopped, report, stepped,
        )  # fmt: skip
        loop.start()
        while len(loop.steps) <= max_steps and loop.go_on():
            pass
        return loop.finished(ceiling=ceiling)


@dataclass
class _Loop:
    """The state of one loop."""

    takes: list[Take]
    usable: UsableSensors
    odd_takes: tuple[OddTake, ...]
    """Set aside, as they do not fit the others."""
    subject: str
    settings: TrainingSettings
    holdout: tuple[Take, ...]
    seed: int
    hashes: tuple[str, ...]
    limits: ImprovementLimits
    cancelled: Cancel | None
    report: Report | None
    stepped: Stepped | None
    steps: list[Step] = field(default_factory=list)
    trials: list[Trial] = field(default_factory=list)
    followed: set[tuple[str, str]] = field(default_factory=set)
    """Effects and rotations that a residual's association asked for."""
    stopped: Stop = "nothing_named"
    diagnosis: Diagnosis | None = None
    diagnosed: list[Take] = field(default_factory=list)
    """The takes of the diagnosis."""
    errors: HeldOutErrors = field(default_factory=lambda: HeldOutErrors({}, {}))
    has_looked: bool = False
    found_before: FoundBefore = field(default_factory=FoundBefore)
    left_out: Iterator[LeftOutWearing] | None = None
    """Wearings that the base has not seen, while they are being fitted."""

    @property
    def layout(self) -> Layout:
        return self.usable.layout

    def start(self) -> None:
        """The base model and its error."""
        self._say("training the base", 0.02)
        model = train(
            self.takes, self.layout, self.subject, replace(self.settings, folds=0),
            take_hashes=self.hashes, cancelled=self.cancelled,
        )  # fmt: skip
        self.usable = replace(self.usable, layout=model.layout)  # what the base is read from stays
        self.settings = settings_of(model, self.settings)
        self._say("measuring the base on held-out takes", 0.1)
        question = PreparedTakes.of(self.takes, self.layout), trained_rotations(model), (), self.settings
        self.errors = held_out_errors(*question, optima=optima_of(model), cancelled=self.cancelled)
        self.left_out = left_out_wearings(*question, optima=optima_of(model), cancelled=self.cancelled)
        self._step(model, None)

    def go_on(self) -> bool:
        """One round; False when the loop is over."""
        model = self.steps[-1].model
        share = 0.15 + 0.12 * len(self.steps)
        found = repairs(model, self._repaired(), self._not_repaired, self.found_before)
        self.has_looked = True
        if self._add_first(found):
            return True
        self._say("diagnosing the residual", share)
        takes = self._repaired()
        self.diagnosis = ModelOnTakes.of_repaired(model, takes).diagnosed(
            noise_floors=self._known_floors(takes), found_before=self.found_before, seed=self.seed,
            limits=self.limits.diagnosis, cancelled=self.cancelled,
        )  # fmt: skip
        self.diagnosed = takes
        if self._is_named_last(self.diagnosis) and self._add_widenings():
            return True
        tried = self._refused
        for item in self.diagnosis.naming.ranked:
            if item.effect in tried:
                continue
            where = [item.joints[i] for i in item.significant_joints]
            tried_effect = self.diagnosis.effects[item.effect]
            constants = None if item.steps is None else item.steps.to_settings()
            if isinstance(tried_effect, RepairEffect) and tried_effect.comparison is not None:
                constants = tried_effect.comparison.constants(item, [take.name for take in self.takes])
            if self._add(item.effect, where, constants, self.diagnosis):
                return True
            self.stopped = "not_better"
            tried.add(item.effect)
            if len(tried) > self.limits.most_undone:
                return False
        if self._add_by_column(self.diagnosis) or self._add_associated(self.diagnosis):
            return True
        if not tried:
            self.stopped = "nothing_named"
        return self._add_widenings()

    def finished(self, *, ceiling: bool) -> Improvement:
        """Sum up."""
        self._with_unseen_wearing()
        floors, limits = self._floors(), self.limits.comparison
        stopped = why_stopped(self.stopped, self.steps, floors, self.diagnosis, limits)
        names = trained_rotations(self.steps[0].model)
        scale = baselines(self.takes, self.layout, names, self.settings, self.holdout)
        found = self._ceiling() if ceiling else None
        self._say("done", 1.0)
        return Improvement(
            tuple(self.steps), floors, stopped, self.diagnosis, tuple(self.trials), scale,
            (*(item.told for item in self.odd_takes), *take_warnings(self.takes)), self.usable,
            self.takes[0].duration_s if len(self.takes) == 1 and not self.holdout else None, found,
        )  # fmt: skip

    def _ceiling(self) -> Ceiling:
        return black_box_ceiling(
            self.steps[-1].model, self.takes, self.settings, seed=self.seed,
            cancelled=self.cancelled, report=part(self._say, 0.9, 1.0, "ceiling"),
        )  # fmt: skip

    def _known_floors(self, takes: Sequence[Take]) -> Mapping[str, NoiseFloor] | None:
        """Those of the last diagnosis, where it was of the same takes: a model has no part in them."""
        if self.diagnosis is None or [id(take) for take in takes] != [id(take) for take in self.diagnosed]:
            return None
        return self.diagnosis.noise_floors

    def _floors(self) -> dict[str, NoiseFloor]:
        """Of the takes on which errors are measured, repaired as the last model repairs them.

        Those of the takes as they came would hold what has been repaired.
        """
        last = self.steps[-1]
        known = noise_floors(residuals(last.model, self.holdout or self.takes), self.limits.comparison)
        return {
            name: floor.beside(last.per_rotation[name]) if name in last.per_rotation else floor
            for name, floor in known.items()
        }

    def _add(
        self,
        name: str,
        where: Sequence[str] | None,
        constants: dict[str, Any] | None,
        diagnosis: Diagnosis | None,
        reasons: tuple[str, ...] = (),
        confidence_set: tuple[str, ...] = (),
        action: Action | None = None,
    ) -> bool:
        self._with_unseen_wearing()
        model = self.steps[-1].model
        every = trained_rotations(model)
        chosen = (
            every
            if where is None or isinstance(effect(name), RepairEffect)
            else [item for item in where if item in every]
        )
        concerned = set((constants or {}).get("where", chosen))
        judged = [item for item in chosen if item in concerned]
        self._say(f"adding {name}", 0.2 + 0.12 * len(self.steps))
        is_later = any(step.added for step in self.steps)
        least = self.limits.later_gain if is_later else self.limits.least_gain
        addition = add_effect(
            model, self.takes, name, rotations=chosen, constants=constants, settings=self.settings,
            before=self.errors.of(chosen), judged=judged, least_gain=least,
            control_share=action.control_share if action else share_in(diagnosis, name, chosen),
            take_hashes=self.hashes,
            limits=self.limits, cancelled=self.cancelled,
        )  # fmt: skip
        if not addition.added:
            self.trials.append(Trial(addition, reasons, diagnosis=diagnosis, action=action))
            return False
        self.errors = self.errors.with_those_of(addition.after)
        model, self.errors, removed = without_redundant(
            addition, self.takes, self.errors, self.settings, self.hashes, self.cancelled, self.limits
        )
        self.trials.append(Trial(addition, reasons, removed, diagnosis, action))
        added = added_in_step(addition, constants, diagnosis, confidence_set, action)
        self._step(model, added)
        return True

    def _add_by_column(self, diagnosis: Diagnosis) -> bool:
        """The effect that is named by the column that measures its cause, if it stays."""
        asked = diagnosis.by_column
        if not asked or asked[0].effect is None or asked[0].effect in self._tried:
            return False
        where = [item.rotation for item in asked]
        return self._add(
            asked[0].effect, where, None, diagnosis, tuple(remedy(item).sentence for item in asked)
        )

    def _add_associated(self, diagnosis: Diagnosis) -> bool:
        """The first effect of a column that the residual goes along with, if it stays; none that may only
        grasp what the form of an earlier one left."""
        for action in diagnosis.actions:
            pair = (action.effect or "", action.rotation)
            if action.effect is None or not action.saves or action.is_within_known or pair in self.followed:
                continue
            self.followed.add(pair)
            if self._add(
                action.effect, [action.rotation], None, diagnosis, (remedy(action).sentence,), action=action
            ):
                return True
        return False

    def _is_named_last(self, diagnosis: Diagnosis) -> bool:
        """Whether it names an effect that seems to be explained by those which it ranks, and is not."""
        names = {item.effect for item in diagnosis.signature if is_asked_last(diagnosis.effects[item.effect])}
        return bool(names - self._tried)

    def _add_widenings(self) -> bool:
        without, takes = self._tried | self._has, self._repaired()
        if len(takes) < self.limits.claim_fewest_takes:
            return False  # the diagnosis names them; no claim can be checked
        steps = widenings(self.steps[-1].model, takes, self.diagnosis, without, self.found_before)
        return self._add_first(steps)

    def _add_first(self, steps: Sequence[Proposed]) -> bool:
        """The first of them that stays."""
        for name, proposal in steps:
            where, alike = proposal.rotations, proposal.confidence_set
            if self._add(name, where, proposal.constants, None, proposal.sentences, alike):
                return True
        return False

    @property
    def _not_repaired(self) -> set[str]:
        """Repairs that are not looked for any more: the search of those that are compared takes long, and
        finds the same after other effects were added."""
        repairs = [item for item in catalogue().values() if isinstance(item, RepairEffect)]
        once = {item.name for item in repairs if item.comparison is not None and self.has_looked}
        return self._tried | self._has | once

    @property
    def _has(self) -> set[str]:
        return {item.name for item in requested_effects(self.steps[-1].model)}

    @property
    def _tried(self) -> set[str]:
        return {
            trial.addition.effect
            for trial in self.trials
            if not trial.addition.added and trial.action is None
        }

    @property
    def _refused(self) -> set[str]:
        """Those tried since the last step: beside another effect one may do what it could not do alone."""
        found: set[str] = set()
        for trial in self.trials:
            if trial.addition.added:
                found.clear()
            elif trial.action is None:
                found.add(trial.addition.effect)
        return found

    def _repaired(self) -> list[Take]:
        return repaired_takes(self.takes, requested_effects(self.steps[-1].model))

    def _with_unseen_wearing(self) -> None:
        """The base gets its error in a wearing that it has not seen, once the diagnosis beside it is done."""
        if self.left_out is None:
            return
        base, wearings = self.steps[0].model, [take.wearing for take in self.takes]
        unseen = unseen_wearing(wearings, list(self.left_out), noise_of(base.rotations))
        self.steps[0] = replace(self.steps[0], model=replace(base, unseen_wearing=unseen))
        self.left_out = None

    def _step(self, model: CalibrationModel, added: AddedInStep | None) -> None:
        per_rotation, overall = step_errors(model, self.holdout, self.errors)
        share = None if added is None else added.control_share
        control = None if added is None or share is None else self._with_control(added.where, share)
        held_out = self.errors.overall_deg
        self.steps.append(Step(model, added, overall, per_rotation, control, held_out))
        if self.stepped:
            self.stepped(self.steps)

    def _with_control(self, rotations: Sequence[str], share: float) -> float:
        """Error over all rotations where a control leaves ``share`` of that of ``rotations``."""
        before, count = self.steps[-1].per_rotation, self.errors.count
        squares = {
            name: count.get(name, 0) * (error * (share if name in rotations else 1.0)) ** 2
            for name, error in before.items()
        }
        return float(np.sqrt(sum(squares.values()) / max(sum(count.get(name, 0) for name in squares), 1)))

    def _say(self, text: str, share: float) -> None:
        if self.report:
            self.report(f"{self._fall_so_far}{text}", min(share, 1.0))

    @property
    def _fall_so_far(self) -> str:
        """The held-out error of each step, and what was undone."""
        fall = [
            f"{'base' if step.added is None else f'+ {step.added.effect}'} {step.rmse_deg:.2f}°"
            for step in self.steps
        ]
        undone = [f"{trial.addition.effect} undone" for trial in self.trials if not trial.addition.added]
        return f"{', '.join([*fall, *dict.fromkeys(undone)])}: " if fall else ""
