"""The gloves that are served: so many at most, and those that send no valid frames make room for others."""

from __future__ import annotations

import logging
import time
from typing import Any

from glovecal_client.errors import BadName, WireError
from glovecal_client.keys import parse_glove_key
from glovecal_client.wire.frame import decode_frame
from glovecal_service.realtime.glove_lane import GloveLane

GLOVES_LIMIT = 256
VALID_WITHIN_NS = 1_000_000_000
"""A glove keeps its place for so long after a valid frame, against any number of new names."""
LOG_EVERY_S = 10.0
_PARTS_SHOWN = 80

_log = logging.getLogger("glovecal.realtime")


class GloveLanes:
    """The lanes by key. Belongs to the predicting thread; ``all`` and ``document`` may be asked by others.

    A glove with a place has sent a valid frame, or nobody else wanted the place so far. So junk on any number
    of names keeps nobody out, and never displaces a glove that sends frames.
    """

    def __init__(self, limit: int = GLOVES_LIMIT) -> None:
        self._limit = limit
        self._by_key: dict[str, GloveLane] = {}
        self._full_until_ns = 0
        """Until then all places belong to gloves that sent a valid frame within a second."""
        self._unusable_names = 0
        self._no_room = 0
        self._given_up = 0
        self._given_up_messages = 0
        self._sentence = ""
        self._logged_at: dict[str, float] = {}

    def all(self) -> list[GloveLane]:
        return list(self._by_key.values())

    def of(self, key: str, message: bytes, received_ns: int) -> GloveLane | None:
        """The lane for a message, a new one for a new glove; None if it is refused, which is counted."""
        lane = self._by_key.get(key)
        return lane if lane is not None else self._admit(key, message, received_ns)

    def document(self) -> dict[str, Any]:
        """For the status document: what was refused before it had a glove, and gloves that made room."""
        return {
            "limit": self._limit,
            "served": len(self._by_key),
            "refused_messages": {"unusable_name": self._unusable_names, "no_room": self._no_room},
            "given_up": {"gloves": self._given_up, "messages": self._given_up_messages},
            "sentence": self._sentence,
        }

    def _admit(self, key: str, message: bytes, received_ns: int) -> GloveLane | None:
        try:
            keys, _ = parse_glove_key(key)
        except BadName as error:
            self._unusable_names += 1
            self._say("name", f"frames are refused: {str(error)[:_PARTS_SHOWN]}")
            return None
        if len(self._by_key) >= self._limit and not self._make_room(keys.glove, message, received_ns):
            self._no_room += 1
            return None
        lane = self._by_key[key] = GloveLane(keys)
        lane.valid_ns = received_ns if _is_frame(message) else 0
        return lane

    def _make_room(self, glove: str, message: bytes, received_ns: int) -> bool:
        if received_ns < self._full_until_ns:
            return False
        if not _is_frame(message):
            self._say(
                "junk", f"glove {glove} is refused: {self._limit} gloves have a place, it sent no frame"
            )
            return False
        key, lane = min(self._by_key.items(), key=lambda item: item[1].valid_ns)
        if received_ns - lane.valid_ns < VALID_WITHIN_NS:
            self._full_until_ns = lane.valid_ns + VALID_WITHIN_NS
            self._say(
                "room", f"glove {glove} is refused: {self._limit} gloves send valid frames, no more can"
            )
            return False
        del self._by_key[key]
        self._given_up += 1
        self._given_up_messages += lane.received
        why = "its last valid frame is more than 1 s old" if lane.valid_ns else "it sent no valid frame"
        self._say("given up", f"glove {lane.glove} made room for glove {glove}: {why}")
        return True

    def _say(self, what: str, sentence: str) -> None:
        """Log the first of a kind and then one in 10 s at most."""
        now = time.monotonic()
        if now - self._logged_at.get(what, -LOG_EVERY_S) < LOG_EVERY_S:
            return
        self._logged_at[what] = now
        self._sentence = sentence
        _log.warning(
            "%s (messages refused so far: %d for their name, %d for want of room; gloves that made room: %d)",
            sentence, self._unusable_names, self._no_room, self._given_up,
        )  # fmt: skip


def _is_frame(message: bytes) -> bool:
    try:
        decode_frame(message)
    except WireError:
        return False
    return True
