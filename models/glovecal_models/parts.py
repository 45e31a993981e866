"""Long work in independent parts: the same in a library's call and in a job's worker processes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from glovecal_models.progress import Cancel, Report, part, stop_if

Result = TypeVar("Result")


@dataclass(frozen=True)
class Part:
    """One piece of the work, told apart from the others by ``facts``."""

    label: str
    """What is worked on, for messages."""
    gives: type
    """Of its result: a dataclass that JSON can hold."""
    facts: Mapping[str, Any] = field(default_factory=dict)
    """JSON-able; with the takes and the model they decide the result."""
    effort: float = 1.0
    """How long it takes beside the other parts."""


class Parted(ABC, Generic[Result]):
    """Work on takes. It is made anew in every process; what is costly to prepare waits for ``run``."""

    def require(self) -> None:
        """Refuse what can be refused without the takes. Raises BadInput."""

    @abstractmethod
    def parts(self) -> Sequence[Part]:
        """Raises BadInput where there is nothing to do, or too much."""

    @abstractmethod
    def run(self, piece: Part, cancelled: Cancel | None, report: Report | None) -> Any:
        """What the part gives. Raises BadInput, Cancelled."""

    @abstractmethod
    def answer(self, pieces: Sequence[Any]) -> Result:
        """From what every part gave, in their order."""

    def answered(self, cancelled: Cancel | None = None, report: Report | None = None) -> Result:
        """All parts, one after the other. Raises BadInput, Cancelled."""
        done, found = 0.0, []
        pieces = self.parts()
        whole = sum(item.effort for item in pieces)
        for item in pieces:
            stop_if(cancelled, item.label)
            until = done + item.effort / whole
            if report is not None:
                report(item.label, done)
            found.append(self.run(item, cancelled, part(report, done, until, item.label)))
            done = until
        return self.answer(found)


@dataclass(frozen=True)
class Undivided(Parted[Result]):
    """Work in one piece, which gives the answer."""

    piece: Part
    worked: Callable[[Cancel | None, Report | None], Result]

    def parts(self) -> Sequence[Part]:
        return [self.piece]

    def run(self, piece: Part, cancelled: Cancel | None, report: Report | None) -> Result:
        return self.worked(cancelled, report)

    def answer(self, pieces: Sequence[Result]) -> Result:
        return pieces[0]
