"""What a glove's poses mean, as JSON on ``glovecal/<site>/<glove>/pose/meta``: on change and to queries.

What the capture daemons say about their gloves: heard when they say it, asked for when they did not.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterable
from dataclasses import dataclass
from threading import Lock
from typing import Any

import zenoh

from glovecal_client.errors import BadName, NoAnswer
from glovecal_client.keys import JSON_ENCODING, GloveKeys, all_gloves, parse_glove_key
from glovecal_client.session import ask, json_object
from glovecal_models.hand.rotations import Handedness
from glovecal_models.takes.take import KnownLatency
from glovecal_service.incoming.arrivals import Arrivals
from glovecal_service.realtime.glove_lanes import GlovePipeline
from glovecal_service.realtime.served_model import ServedModel


@dataclass(frozen=True)
class Serving:
    """How one glove is served, and why not better."""

    subject: str | None = None
    layout: str | None = None
    model: ServedModel | None = None
    sentence: str = ""
    wearing: str | None = None
    run_id: str = ""
    """The run of the capture daemon that this was decided for."""
    latency: KnownLatency | None = None
    """How late the glove is known to be: the poses' times and ages hold it."""
    hand: Handedness | None = None
    skeleton: dict[str, Any] | None = None
    """The wearer's hand, ``skeleton_document``; None where nobody said which hand or who wears it."""

    def document(self, glove: str) -> dict[str, Any]:
        """``rotations`` are in the order of the pose's numbers."""
        model = self.model
        return {
            "glove": glove,
            "state": "uncalibrated" if model is None else "calibrated",
            "sentence": self.sentence,
            "subject": self.subject,
            "wearing": self.wearing,
            "layout": self.layout,
            "run_id": self.run_id,
            "glove_latency_s": None if self.latency is None else self.latency.seconds,
            "glove_latency_sd_s": None if self.latency is None else self.latency.sd_s,
            "model": None if model is None else model.model_id,
            "method": None if model is None else model.method,
            "model_simulated": None if model is None else model.simulated,
            "effects": [] if model is None else list(model.effects),
            "rotations": [] if model is None else list(model.rotations),
            "hand": self.hand or "unknown",
            "skeleton": self.skeleton,
        }


class PoseMetas:
    """Keeps each glove's document, publishes it when it changes, answers queries."""

    def __init__(self, session: zenoh.Session, site: str) -> None:
        self._session = session
        self._site = site
        self._lock = Lock()
        self._documents: dict[str, dict[str, Any]] = {}
        self._queryable = session.declare_queryable(all_gloves(site, "pose/meta"), self._answer)

    def put(self, glove: str, serving: Serving) -> None:
        """Publish if it differs from what was said before."""
        document = serving.document(glove)
        with self._lock:
            if self._documents.get(glove) == document:
                return
            self._documents[glove] = document
        self._session.put(
            GloveKeys(self._site, glove).pose_meta, json.dumps(document), encoding=JSON_ENCODING
        )

    def forget(self, glove: str) -> None:
        with self._lock:
            self._documents.pop(glove, None)

    def documents(self) -> dict[str, dict[str, Any]]:
        """All documents by glove."""
        with self._lock:
            return dict(self._documents)

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            for glove, document in self.documents().items():
                key = GloveKeys(self._site, glove).pose_meta
                if query.key_expr.intersects(zenoh.KeyExpr(key)):
                    query.reply(key, json.dumps(document), encoding=JSON_ENCODING)


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

    def news(self, lanes: Iterable[GlovePipeline]) -> set[str]:
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

    def _is_unknown(self, lane: GlovePipeline) -> bool:
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
