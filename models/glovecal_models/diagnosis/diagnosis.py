"""What a diagnosis found: evidence, a named effect or a reason why there is none, and the next take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.diagnosis.actions import Action, together
from glovecal_models.diagnosis.camera_errors import CameraErrors
from glovecal_models.diagnosis.hold_drift import HoldDrift
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.naming import Naming
from glovecal_models.diagnosis.next_take import NextTake
from glovecal_models.diagnosis.not_identifiable import NotIdentifiable
from glovecal_models.diagnosis.signatures import is_outweighed, may_explain
from glovecal_models.diagnosis.unexplained_residual import UnexplainedResidual
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.facts import Kind
from glovecal_models.effects.base.signature_effect import Finding

Verdict = Literal["named", "ambiguous", "associated"]
"""Of an effect: the only one that explains the error, one of several that may, or one that was tried because
the residual goes along with a recorded column: no cause is claimed."""


@dataclass(frozen=True)
class NamedEffect:
    """The effect that a diagnosis names first."""

    effect: str
    where: tuple[str, ...]
    """Rotations; sensors or takes where it is a fault of those."""
    kind: Kind | None
    """None where it is named by a drift within held poses: ``where`` are sensors then. ``finding``: no
    model is better for what was found, whatever kind the effect is."""
    confidence_set: tuple[str, ...]
    """It and all that these takes cannot tell from it."""
    parameters: Mapping[str, Mapping[str, float] | float]
    """Learned numbers, units in their names; of each rotation where it was compared."""
    saved_deg: float | None = None
    """Held-out RMSE without it minus with it; None where it was found by its signature."""
    control_saved_deg: float | None = None
    """The same of its control."""
    method: str | None = None
    """The training method whose base learns it by itself, where this base is a straight line."""

    @property
    def verdict(self) -> Verdict:
        return "named" if len(self.confidence_set) < 2 else "ambiguous"


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
    findings: tuple[Finding, ...]
    """What is known by a signature in the recording."""
    residual: UnexplainedResidual
    next_take: NextTake | None
    actions: tuple[Action, ...] = ()
    """What the associations of the residual ask for, what saves most first."""
    effects: Mapping[str, Effect]
    """Those asked for, by name."""
    hold_drift: HoldDrift | None = None
    """Where the reference only names poses: what the readings do while one is held."""
    linear: bool = False
    """Whether the base is a straight line."""
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS
    camera: CameraErrors | None = None
    """What is the reference's own, where it states deviations; None where it states none."""

    @property
    def signature(self) -> tuple[Finding, ...]:
        """Findings of the effect that is to be named by its signature, before any ranking; mostly none."""
        repairs = {item.effect for item in self.findings if self.effects[item.effect].kind == "repair"}
        for name in dict.fromkeys(item.effect for item in self.findings if item.effect in repairs):
            found = tuple(item for item in self.findings if item.effect == name)
            if name not in self.naming.confidence_set and not is_outweighed(found, self.naming):
                return found
        if self.naming.ranked:
            wholes = [item for item in self.findings if self.effects[item.effect].also_explained_by]
            by_effect = {
                item.effect: [each for each in wholes if each.effect == item.effect] for item in wholes
            }
            return tuple(
                finding
                for name, found in by_effect.items()
                if may_explain(self.effects[name], self.naming, found, self.effects)
                for finding in found
            )
        return tuple(item for item in self.findings if item.effect == self.findings[0].effect)

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
        if self.signature:
            return self._named_by_signature()
        if self.naming.ranked:
            return self._named_by_comparison()
        if self.by_column:
            return self._named_by_column()
        held = self.hold_drift
        return None if held is None or not held.confidence_set else _named_by_drift(held)

    @property
    def by_column(self) -> tuple[Action, ...]:
        """One for each rotation, where an effect is named because the residual goes along with the very
        column that measures its cause: where nothing else is named, and beside no other effect, whose form
        may have left as much. Empty otherwise."""
        if self.naming.ranked or self.findings or any(item.known_saved_square for item in self.assessments):
            return ()
        found = [item for item in self.actions if item.saves and self._is_own_column(item)]
        return tuple(item for item in found if item.effect == found[0].effect)

    def _is_own_column(self, action: Action) -> bool:
        effect = self.effects.get(action.effect or "")
        share = action.saved_share
        if effect is None or not action.is_physical or share is None:
            return False
        return (
            action.association.column in [f"context {name}" for name in effect.context]
            and share >= self.limits.own_column_share
        )

    def _named_by_signature(self) -> NamedEffect:
        first, rivals = self.signature[0], self.naming.confidence_set
        is_only_told = all(item.is_only_told for item in self.signature)
        return NamedEffect(
            first.effect,
            tuple(sorted({name for item in self.signature for name in item.where})),
            "finding" if is_only_told else self.effects[first.effect].kind,
            tuple(dict.fromkeys((first.effect, *rivals))) if first.effect in rivals else (first.effect,),
            dict(first.evidence),
        )

    def _named_by_comparison(self) -> NamedEffect:
        item = self.naming.ranked[0]
        rmse = item.rmse_deg
        return NamedEffect(
            item.effect,
            tuple(item.joints[i] for i in item.significant_joints),
            self.effects[item.effect].kind,
            self.naming.confidence_set,
            {item.joints[i]: item.shape_described(i) for i in item.significant_joints},
            rmse.before - rmse.after,
            rmse.before - rmse.control,
            self.effects[item.effect].learned_by if self.linear else None,
        )

    def _named_by_column(self) -> NamedEffect:
        asked = self.by_column
        name, rmse = asked[0].effect or "", together(asked)
        return NamedEffect(
            name,
            tuple(item.rotation for item in asked),
            self.effects[name].kind,
            (name,),
            {},
            rmse.before - rmse.after,
            rmse.before - rmse.control,
            self.effects[name].learned_by if self.linear else None,
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
