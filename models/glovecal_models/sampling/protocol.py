"""A sampling protocol: steps in their order, what each asks of the person, and the time that they take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean

Kind = Literal["range", "verification", "fk_independent", "fk_cross_couple", "ik"]
"""``range`` shows how far each sensor goes, ``verification`` whether the glove stayed where it was; the
others are the paper's three kinds of sample (Wang & Neff 2013, section 4)."""
Motion = Literal["hold", "move"]


@dataclass(frozen=True)
class Step:
    """Plain data; a protocol is a sequence of these."""

    name: str
    """Unique in its protocol."""
    kind: Kind
    motion: Motion
    """``hold``: the whole hand is still while it is recorded; ``move``: all but ``angles`` moves freely."""
    ask: str
    """A short sentence to read out."""
    seconds: float
    """How long it is recorded."""
    part: str
    """Steps of one part, one after the other, make one take."""
    pose: str = ""
    """What the frames are called in the take."""
    angles: Mapping[str, float] = field(default_factory=dict)
    """Degrees by rotation that hold all the time; what is not named is not known."""
    moves: tuple[str, ...] = ()
    """Sensors that have to move."""
    needs: str = ""
    """What to take in the hand first."""
    touches: tuple[str, ...] = ()
    """Digits (T, I, M, R, P) whose tips are held together, or against the ends of the rod."""
    rod_mm: float | None = None
    """Distance of the two tips; None: they touch."""
    repeats: str = ""
    """Name of the step that this one does again, as a check; "" for none."""

    def to_document(self) -> dict[str, Any]:
        return asdict(self) | {"angles": dict(self.angles)}

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Step:
        lists = {name: tuple(document[name]) for name in ("moves", "touches")}
        return cls(**{**document, **lists})


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
    seed: int | None = None
    """Of the random order of poses and widgets; None: they are in their fixed order."""

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
        raise BadInput(f"no step {name!r} in protocol {self.name}; {did_you_mean(name, self._names)}")

    @property
    def _names(self) -> list[str]:
        return [step.name for step in self.steps]

    def to_document(self) -> dict[str, Any]:
        steps = [step.to_document() for step in self.steps]
        document = {"name": self.name, "steps": steps, "grows": self.grows}
        return document | {"equipment": dict(self.equipment), "seed": self.seed}

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Protocol:
        steps = tuple(Step.from_document(step) for step in document["steps"])
        grows, equipment = document.get("grows", False), document.get("equipment", {})
        return cls(document["name"], steps, bool(grows), equipment, document.get("seed"))
