"""What became of a walk: its steps, where it stopped and why, as data and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.hold_drift_document import hold_document
from glovecal_models.diagnosis.next_take import NextTake
from glovecal_models.effects.base.signature_effect import SignatureEffect
from glovecal_models.effects.catalogue import effect
from glovecal_models.improvement.addition import Addition


@dataclass(frozen=True)
class Step:
    """One model on the way."""

    model: CalibrationModel
    added: dict[str, Any] | None
    rmse_deg: float
    per_rotation: dict[str, float]
    decoy_rmse_deg: float | None = None
    """What the error would be with the effect's decoy instead: the share it saves, of the step before."""


@dataclass(frozen=True)
class Improvement:
    """The whole walk."""

    steps: tuple[Step, ...]
    noise_floor: dict[str, NoiseFloor]
    stopped: str
    diagnosis: Diagnosis | None
    """The last one: what is left, and what to record next."""
    undone: tuple[Addition, ...]
    baselines: dict[str, float] = field(default_factory=dict)
    """Errors (deg) of simpler calibrations on the same takes, for scale."""
    sentences: tuple[str, ...] = ()

    @property
    def models(self) -> tuple[CalibrationModel, ...]:
        """One for each step."""
        return tuple(step.model for step in self.steps)

    def to_document(self, model_ids: Sequence[str | None] | None = None) -> dict[str, Any]:
        """The JSON contract of ``glovecal improve``; ids are those under which the models were stored."""
        ids = list(model_ids) if model_ids is not None else [None] * len(self.steps)
        ambiguous = next(
            (s.added for s in reversed(self.steps) if s.added and s.added["verdict"] == "ambiguous"), None
        )
        following = self.diagnosis.next_take if self.diagnosis else None
        if following is None and ambiguous is not None:
            following = ambiguous.get("next_take")
        elif following is not None:
            following = next_take_document(following)
        return {
            "steps": [
                {
                    "model": id,
                    "added": step.added,
                    "rmse_deg": step.rmse_deg,
                    "per_rotation": step.per_rotation,
                    "decoy_rmse_deg": step.decoy_rmse_deg,
                }
                for id, step in zip(ids, self.steps, strict=True)
            ],
            "baselines": self.baselines,
            "noise_floor_deg": {name: floor.floor_deg for name, floor in self.noise_floor.items()},
            "noise_floor_interval_deg": {
                name: [floor.low_deg, floor.high_deg] for name, floor in self.noise_floor.items()
            },
            "stopped": self.stopped,
            "undone": [item.to_document() for item in self.undone],
            "hold_drift": self._hold_drift(),
            "something_left": bool(self.diagnosis and self.diagnosis.left.is_left),
            "next_take": following,
            "sentences": list(self.sentences),
        }

    def _hold_drift(self) -> dict[str, Any] | None:
        held = self.diagnosis.hold_drift if self.diagnosis else None
        return None if held is None else hold_document(held)


def added_document(
    addition: Addition, constants: dict[str, Any] | None, diagnosis: Diagnosis | None
) -> dict[str, Any]:
    rivals = [addition.effect] if diagnosis is None else list(diagnosis.naming.confidence_set)
    if addition.effect not in rivals:
        rivals = [addition.effect]
    parameters: dict[str, Any] = dict(addition.parameters)
    known = effect(addition.effect)
    if constants is not None and addition.claim is None and isinstance(known, SignatureEffect):
        parameters = known.described_constants(constants)
    document: dict[str, Any] = {
        "effect": addition.effect,
        "where": list((constants or {}).get("where", addition.rotations)),
        "verdict": "named" if len(rivals) < 2 else "ambiguous",
        "confidence_set": rivals,
        "parameters": parameters,
    }
    if addition.claim is not None:
        document["claim"] = addition.claim.to_document()
    if diagnosis is not None and diagnosis.next_take is not None and len(rivals) > 1:
        document["next_take"] = next_take_document(diagnosis.next_take)
    return document


def next_take_document(take: NextTake) -> dict[str, Any]:
    """Plain JSON-able data."""
    return {"what": take.what, "seconds": take.seconds, "separates": list(take.separates)}
