"""Who asks the store: of whom its rows are shown, and in whose name changes are written down."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass


@dataclass(frozen=True)
class Actor:
    name: str = "this computer"
    """Of a key; by default who works on the data folder itself, and the service's own processes."""
    origin: str = ""
    """The address that a request came from."""
    action: str = ""
    """What was asked, such as ``POST /v1/models/train``."""
    subjects: frozenset[str] | None = None
    """Whose rows there are for it; None: everybody's."""

    def sees(self, subject: str | None) -> bool:
        """Whether what this subject does is shown; what nobody wears is."""
        return self.subjects is None or subject is None or subject in self.subjects


_ACTOR: ContextVar[Actor] = ContextVar("actor", default=Actor())  # noqa: B039  # frozen


def actor() -> Actor:
    return _ACTOR.get()


@contextmanager
def acting(as_one: Actor) -> Iterator[None]:
    """Inside the block, and in threads begun with a copy of its context."""
    token = _ACTOR.set(as_one)
    try:
        yield
    finally:
        _ACTOR.reset(token)
