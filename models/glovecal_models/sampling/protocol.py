"""A sampling protocol: steps in their order, and the time that they take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from glovecal_models.errors import BadInput
from glovecal_models.sampling.step import Step

COUNTDOWN_S = 2.0
SETTLE_S = 0.5
"""The hand has to be still for so long before a pose is recorded."""


def step_capture_s(step: Step) -> float:
    """Countdown, settling and recording, in seconds."""
    return COUNTDOWN_S + (SETTLE_S if step.motion == "hold" else 0.0) + step.seconds


@dataclass(frozen=True)
class Protocol:
    """Raises BadInput for no steps, or two of one name."""

    name: str
    steps: tuple[Step, ...]
    grows: bool = False
    """Further steps are chosen when these are done."""
    equipment: Mapping[str, Any] = field(default_factory=dict)
    """What the person has (``Equipment.to_document()``), for steps that are still to be chosen."""

    def __post_init__(self) -> None:
        names = [step.name for step in self.steps]
        if not names:
            raise BadInput(f"protocol {self.name!r} has no step that this glove's layout could learn from")
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise BadInput(f"protocol {self.name!r}: two steps are named {twice!r}")

    @property
    def capture_s(self) -> float:
        """Countdowns, settling and recording of a person who does every step at once, in seconds."""
        return sum(step_capture_s(step) for step in self.steps)

    def step(self, name: str) -> Step:
        """Raises BadInput."""
        for step in self.steps:
            if step.name == name:
                return step
        raise BadInput(f"no step {name!r} in protocol {self.name}; there are {', '.join(self._names)}")

    @property
    def _names(self) -> list[str]:
        return [step.name for step in self.steps]

    def to_document(self) -> dict[str, Any]:
        steps = [step.to_document() for step in self.steps]
        document = {"name": self.name, "steps": steps, "grows": self.grows}
        return document | {"equipment": dict(self.equipment)}

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Protocol:
        steps = tuple(Step.from_document(step) for step in document["steps"])
        grows, equipment = document.get("grows", False), document.get("equipment", {})
        return cls(document["name"], steps, bool(grows), equipment)
