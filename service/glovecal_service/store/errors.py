"""What can go wrong with stored things, as the caller has to tell them apart.

    StoreError
    ├── NotFound           no such thing: nothing to do but to name another
    ├── Conflict           the thing exists, but not in a state that allows this
    ├── StorageFull        no room; nothing was changed, works again once there is room
    ├── StoreUnavailable   the database does not answer now; try again
    └── StoreDamaged       rows or the database file are not what was written; restore a backup
        └── DamagedRows    some rows of a list; the others are sound

Damaged artifacts are ``glovecal_models.errors.DamagedArtifact``, bad names and values ``BadInput``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from glovecal_models.errors import GlovecalError


class StoreError(GlovecalError):
    """Base of the errors of the store."""


class NotFound(StoreError, LookupError):
    """There is no such thing."""


class Conflict(StoreError):
    """The state of stored things does not allow this; nothing was changed."""


class StorageFull(StoreError):
    """The disk (or quota) is full; nothing was changed."""


class StoreUnavailable(StoreError):
    """The database cannot be reached or stays locked; trying again later may help."""


class StoreDamaged(StoreError):
    """Something stored is not what was written."""


class TakenOver(Conflict):
    """Another process has what this one began."""


class DamagedRows(StoreDamaged):
    """Some rows of a list are not what was written.

    ``damaged`` has a sentence for each, ``sound`` the records of the others: who can do without the damaged
    ones may go on with those.
    """

    def __init__(self, damaged: Sequence[str], sound: Sequence[Any]) -> None:
        more = len(damaged) - 1
        super().__init__(damaged[0] + (f"; {more} more like it" if more else ""))
        self.damaged = list(damaged)
        self.sound = list(sound)
