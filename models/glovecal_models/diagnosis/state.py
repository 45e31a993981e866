"""What a diagnosis knows at one point of its rules, and which rules have decided so far."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.diagnosis.actions import Action
from glovecal_models.diagnosis.answer import Decision
from glovecal_models.diagnosis.camera_errors import CameraErrors
from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.naming import Naming
from glovecal_models.diagnosis.next_take import NotIdentifiable
from glovecal_models.diagnosis.problem import DiagnosisProblem
from glovecal_models.diagnosis.unexplained_residual import UnexplainedResidual
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.findings import Finding, FoundBefore
from glovecal_models.effects.base.relations import Whole
from glovecal_models.effects.catalogue import relations
from glovecal_models.layout import Layout
from glovecal_models.progress import Cancel, Report, stop_if
from glovecal_models.takes.take import Take


@dataclass(frozen=True, kw_only=True)
class Choices:
    """What may be chosen of a diagnosis."""

    linear: bool = False
    """Whether the base is a straight line of the measuring sensor."""
    known: tuple[KnownEffect, ...] = ()
    """Effects that the model has; they are part of the base."""
    effects: tuple[Effect, ...] | None = None
    """None: all that these takes may show."""
    signatures: bool = True
    """Without them and ``judge_residual`` only the naming is worked out, in less time."""
    judge_residual: bool = True
    own: tuple[Effect, ...] = ()
    """Effects that the user declared, compared with the catalogue's."""
    noise_floors: Mapping[str, NoiseFloor] | None = None
    """Of these takes, where they were measured before; None: they are measured."""
    found_before: FoundBefore | None = None
    """Signatures that were looked for before."""
    seed: int = 0
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS
    """They decide the verdicts."""
    cancelled: Cancel | None = None
    report: Report | None = None
    without: frozenset[str] = frozenset()
    """Names of rules that are left out: for the study of what each is worth."""


@dataclass(frozen=True, kw_only=True)
class Question(Choices):
    """What a diagnosis is asked; the same for all rules."""

    takes: tuple[Take, ...]
    layout: Layout
    catalogue: tuple[Effect, ...]
    """All effects that these takes may show, declared ones included."""
    compared: tuple[Effect, ...]
    """Those whose held-out errors are compared."""
    waiting: tuple[Effect, ...]
    """Those that the takes cannot show, as they are single poses or the hand keeps still."""
    by_name: Mapping[str, Effect]
    """All of them."""
    floors: Mapping[str, NoiseFloor]
    """Noise floor of each rotation where it is known."""

    def progress(self, text: str, share: float) -> None:
        """Say how far the work is. Raises Cancelled."""
        stop_if(self.cancelled, "the diagnosis")
        if self.report:
            self.report(text, share)

    @property
    def wholes(self) -> list[Whole]:
        """Effects of the model that others seem to explain a part of."""
        every = [relations().whole(item.effect.name) for item in self.known]
        return [item for item in every if item.parts]


NO_RESIDUAL = UnexplainedResidual()
NOTHING_NAMED = Naming()


@dataclass(frozen=True, kw_only=True)
class State:
    """Evidence and verdicts so far. A rule takes a state and returns it changed."""

    question: Question
    problem: DiagnosisProblem
    design: ForwardDesign
    """Of ``problem`` at the usual smoothing."""
    beside: DiagnosisProblem
    """The same with effects in the base that these takes cannot decide and that save more than any other."""
    screened: ForwardDesign
    """Of ``beside``."""
    saved: Mapping[str, float]
    """Degrees squared per row that the model's effects save on each rotation; empty without any."""
    has: frozenset[str]
    """Effects that are not asked for: the model has them."""
    camera: CameraErrors | None
    """None where no reference states deviations."""
    assessments: tuple[Assessment, ...] = ()
    not_identifiable: tuple[NotIdentifiable, ...] = ()
    naming: Naming = NOTHING_NAMED
    findings: tuple[Finding, ...] = ()
    outweighed: frozenset[str] = frozenset()
    """Effects that were found and explain far less error than the first of the ranking."""
    signature: tuple[Finding, ...] = ()
    """Findings of the effect that is named by its signature."""
    after: DiagnosisProblem | None = None
    """``problem`` with the first of the ranking in the base; None where the residual is not judged."""
    rest: ForwardDesign | None = None
    """Of ``after``."""
    settled: ForwardDesign | None = None
    """``rest`` without what the unknown start of a memory leaves."""
    unsettled: tuple[str, ...] = ()
    """Effects whose memory outlasts the takes."""
    healthy: frozenset[str] = frozenset()
    """Rotations whose error is a healthy glove's."""
    residual: UnexplainedResidual = NO_RESIDUAL
    actions: tuple[Action, ...] = ()
    by_column: tuple[Action, ...] = ()
    """Those that name an effect by the column that measures its cause."""
    decided: tuple[Decision, ...] = ()

    def because(self, rule: str, effects: Sequence[str], sentence: str, **changes: Any) -> State:
        """The state with ``changes`` of its fields, which ``rule`` made."""
        decision = Decision(rule, tuple(dict.fromkeys(effects)), sentence)
        return replace(self, **changes, decided=(*self.decided, decision))

    @property
    def lacking(self) -> list[Effect]:
        """Effects of the catalogue that the model does not have."""
        return [item for item in self.question.catalogue if item.name not in self.has]
