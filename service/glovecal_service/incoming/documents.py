"""JSON documents of capture daemons, let in within bounds: how large, how many of a glove at once, and of
which gloves. What is too much is thrown away before it is read.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import zenoh

from glovecal_client.errors import BadName
from glovecal_client.keys import all_gloves, parse_glove_key
from glovecal_client.session import MAX_PUT_BYTES, json_object
from glovecal_service.incoming.arrivals import Arrivals

MOST_OF_A_GLOVE = 8
"""The newest of those that wait."""
MOST_BYTES = 1 << 20
"""Read at a time, all gloves together, beyond the first document of each."""
WAITING_LIMIT = 512


class Document(NamedTuple):
    glove: str
    content: dict[str, Any]
    received_ns: int


class Documents:
    """One plane of all gloves of a site, such as ``status``. For one thread at a time."""

    def __init__(self, session: zenoh.Session, site: str, plane: str) -> None:
        self._arrivals = Arrivals(session, all_gloves(site, plane), limit=WAITING_LIMIT)

    def take(self, is_believed: Callable[[str], bool]) -> list[Document]:
        """What came since the last call of the gloves that ``is_believed`` says, oldest first; no waiting."""
        taken: list[tuple[str, bytes, int]] = []
        of_glove: dict[str, int] = {}
        left = MOST_BYTES
        for arrival in reversed(self._arrivals.drain()):
            glove = _glove_of(arrival.key)
            count = of_glove.get(glove, 0)
            if len(arrival.payload) > MAX_PUT_BYTES or count >= MOST_OF_A_GLOVE:
                continue
            if not glove or (count and left < len(arrival.payload)) or not is_believed(glove):
                continue
            of_glove[glove] = count + 1
            left -= len(arrival.payload)
            taken.append((glove, arrival.payload, arrival.received_ns))
        read = ((glove, json_object(payload), at_ns) for glove, payload, at_ns in reversed(taken))
        return [Document(glove, content, at_ns) for glove, content, at_ns in read if content is not None]


def _glove_of(key: str) -> str:
    """ "" for a name that no glove can have."""
    try:
        return parse_glove_key(key)[0].glove
    except BadName:
        return ""
