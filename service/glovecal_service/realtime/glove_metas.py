"""What the capture daemons say about their gloves: heard when they say it, asked for when they did not."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

import zenoh

from glovecal_client.errors import BadName, NoAnswer
from glovecal_client.keys import GloveKeys, all_gloves, parse_glove_key
from glovecal_client.queries import ask, json_object
from glovecal_service.incoming.arrivals import Arrivals
from glovecal_service.realtime.glove_lane import GloveLane

ASK_EVERY_S = 2.0
_ANSWER_WITHIN_S = 0.5
_CHANGES_ALL_THE_TIME = ("log_from", "log_to")


class GloveMetas:
    """The newest meta of each glove. For one thread."""

    def __init__(self, session: zenoh.Session, site: str) -> None:
        self._session = session
        self._site = site
        self._arrivals = Arrivals(session, all_gloves(site, "meta"), limit=1024)
        self._metas: dict[str, dict[str, Any]] = {}
        self._asked_at: dict[str, float] = {}

    def of(self, glove: str) -> dict[str, Any] | None:
        return self._metas.get(glove)

    def forget(self, glove: str) -> None:
        """No longer remember when it was asked."""
        self._asked_at.pop(glove, None)

    def news(self, lanes: Iterable[GloveLane]) -> set[str]:
        """Gloves whose meta changed since the last call; a glove that streams without one is asked for it."""
        changed = {self._note(item.key, item.payload) for item in self._arrivals.drain()}
        for lane in lanes:
            if self._is_unknown(lane):
                changed |= self.ask(lane.glove)
        return changed - {""}

    def ask(self, glove: str = "*") -> set[str]:
        """Ask one glove, or all, for its meta; the gloves whose answer was news."""
        self._asked_at[glove] = time.monotonic()
        key = all_gloves(self._site, "meta") if glove == "*" else GloveKeys(self._site, glove).meta
        try:
            answers = ask(self._session, key, timeout_s=_ANSWER_WITHIN_S)
        except NoAnswer:
            return set()
        return {self._note(str(answer.key_expr), answer.payload.to_bytes()) for answer in answers} - {""}

    def _is_unknown(self, lane: GloveLane) -> bool:
        run_id = lane.gate.run_id
        meta = self._metas.get(lane.glove)
        known = run_id is None or (meta is not None and meta.get("run_id") == f"{run_id:016x}")
        return not known and time.monotonic() - self._asked_at.get(lane.glove, -ASK_EVERY_S) >= ASK_EVERY_S

    def _note(self, key: str, payload: bytes) -> str:
        meta = json_object(payload)
        try:
            keys, _ = parse_glove_key(key)
        except BadName:
            return ""
        if meta is None or not _differs(meta, self._metas.get(keys.glove)):
            return ""
        self._metas[keys.glove] = meta
        return keys.glove


def _differs(meta: dict[str, Any], earlier: dict[str, Any] | None) -> bool:
    if earlier is None:
        return True
    names = (set(meta) | set(earlier)).difference(_CHANGES_ALL_THE_TIME)
    return any(meta.get(name) != earlier.get(name) for name in names)
