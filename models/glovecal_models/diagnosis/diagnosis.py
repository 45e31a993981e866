"""What a diagnosis found: evidence, a named effect or a reason why there is none, and the next take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.diagnosis.actions import Action, together
from glovecal_models.diagnosis.answer import Decision, NamedEffect
from glovecal_models.diagnosis.camera_errors import CameraErrors
from glovecal_models.diagnosis.hold_drift import HoldDrift
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.naming import Naming
from glovecal_models.diagnosis.next_take import NOTHING_LACKING, LackingTakes, NotIdentifiable
from glovecal_models.diagnosis.residual_answer import NextTake, TakePlan
from glovecal_models.diagnosis.unexplained_residual import UnexplainedResidual
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.effect import Effect, kind_of
from glovecal_models.effects.base.findings import Finding
from glovecal_models.effects.catalogue import relations
from glovecal_models.takes.channel_faults import ChannelFault
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import sensor_sentences


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """Ranked evidence for effects that a model does not know yet."""

    joints: tuple[str, ...]
    rmse_deg: dict[str, float]
    """Held-out error of each joint without any further effect, on smoothed signals."""
    noise_floors: dict[str, NoiseFloor]
    """Of the takes, as every other verb tells it."""
    naming: Naming
    assessments: tuple[Assessment, ...]
    """Every identifiable effect."""
    not_identifiable: tuple[NotIdentifiable, ...]
    reference_problems: tuple[str, ...]
    sensor_faults: tuple[tuple[Take, ChannelFault], ...] = ()
    """Those that readings show by themselves; rotations are read from other sensors where there are any."""
    findings: tuple[Finding, ...]
    """What is known by a signature in the recording."""
    signature: tuple[Finding, ...] = ()
    """Findings of the effect that is to be named by its signature, before any ranking; mostly none."""
    residual: UnexplainedResidual
    next_take: NextTake | None
    lacking: LackingTakes = NOTHING_LACKING
    """What these takes lack to judge more."""
    actions: tuple[Action, ...] = ()
    """What the associations of the residual ask for, what saves most first."""
    by_column: tuple[Action, ...] = ()
    """One for each rotation, where an effect is named because the residual goes along with the very column
    that measures its cause."""
    effects: Mapping[str, Effect]
    """Those asked for, by name."""
    hold_drift: HoldDrift | None = None
    """Where the reference only names poses: what the readings do while one is held."""
    linear: bool = False
    """Whether the base is a straight line."""
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS
    camera: CameraErrors | None = None
    """What is the reference's own, where it states deviations; None where it states none."""
    decided: tuple[Decision, ...] = ()
    """Which rules changed something, in their order."""

    @property
    def take_plan(self) -> TakePlan | None:
        """All that further takes can decide, what ``next_take`` tells apart included."""
        return self.lacking.plan(self.next_take)

    @property
    def sensor_problems(self) -> tuple[str, ...]:
        """Sentences on ``sensor_faults``."""
        return tuple(sensor_sentences(self.sensor_faults))

    @property
    def ranked_assessments(self) -> list[Assessment]:
        """All assessments, significant ones first, then by how much they save."""
        return sorted(
            self.assessments,
            key=lambda item: (
                not item.significant_joints,
                -item.saved_square,
                -max(e.contrast for e in item.errors),
            ),
        )

    @property
    def named(self) -> NamedEffect | None:
        """By its signature, else by the held-out error it saves, else by the drift within held poses."""
        found = self._named
        if found is None or len(found.confidence_set) < 2:
            return found
        return replace(found, verdict="ambiguous")

    @property
    def _named(self) -> NamedEffect | None:
        if self.signature:
            return self._named_by_signature()
        if self.naming.ranked:
            return self._named_by_comparison()
        if self.by_column:
            return self._named_by_column()
        held = self.hold_drift
        return None if held is None or not held.confidence_set else _named_by_drift(held)

    def _named_by_signature(self) -> NamedEffect:
        first, rivals = self.signature[0], self.naming.confidence_set
        is_only_told = all(item.is_only_told for item in self.signature)
        return NamedEffect(
            first.effect,
            tuple(sorted({name for item in self.signature for name in item.where})),
            "finding" if is_only_told else kind_of(self.effects[first.effect]),
            tuple(dict.fromkeys((first.effect, *rivals))) if first.effect in rivals else (first.effect,),
            dict(first.evidence),
        )

    def _named_by_comparison(self) -> NamedEffect:
        item = self.naming.ranked[0]
        rmse = item.rmse_deg
        return NamedEffect(
            item.effect,
            tuple(item.joints[i] for i in item.significant_joints),
            kind_of(self.effects[item.effect]),
            self.naming.confidence_set,
            {item.joints[i]: item.shape_described(i) for i in item.significant_joints},
            rmse.before - rmse.after,
            rmse.before - rmse.control,
            dict(relations().of_the_base).get(item.effect) if self.linear else None,
        )

    def _named_by_column(self) -> NamedEffect:
        asked = self.by_column
        name, rmse = asked[0].effect or "", together(asked)
        return NamedEffect(
            name,
            tuple(item.rotation for item in asked),
            kind_of(self.effects[name]),
            (name,),
            {},
            rmse.before - rmse.after,
            rmse.before - rmse.control,
            dict(relations().of_the_base).get(name) if self.linear else None,
        )


def _named_by_drift(held: HoldDrift) -> NamedEffect:
    first = held.poses[0]
    consistent = held.consistent(first)
    return NamedEffect(
        held.confidence_set[0],
        tuple(name for name, _ in consistent),
        None,
        held.confidence_set,
        {
            name: {f"change_in_{first.pose}_pct": 100.0 * share, "tau_s": first.tau_s}
            for name, share in consistent
        },
    )
