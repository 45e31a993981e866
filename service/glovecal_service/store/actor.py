"""Who asks the store: of whom its rows are shown, and in whose name changes are written down."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import Connection


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


NOBODY_ELSE = Actor()
OPTION = "glovecal_actor"
"""Of a connection: what happens on it is asked by this actor."""


def actor_of(connection: Connection) -> Actor:
    return connection.get_execution_options().get(OPTION, NOBODY_ELSE)
