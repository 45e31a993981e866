"""One step of a sampling protocol: what is asked of the person, and what is then known of the angles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

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

    def to_document(self) -> dict[str, Any]:
        return asdict(self) | {"angles": dict(self.angles)}

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Step:
        lists = {name: tuple(document[name]) for name in ("moves", "touches")}
        return cls(**{**document, **lists})
