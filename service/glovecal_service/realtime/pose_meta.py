"""What a glove's poses mean, as JSON on ``glovecal/<site>/<glove>/pose/meta``: on change and to queries.

What the capture daemons say about their gloves: heard when they say it, asked for when they did not.
"""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from threading import Lock
from typing import Any

import zenoh

from glovecal_client.clock import clock_ns
from glovecal_client.errors import BadName, NoAnswer
from glovecal_client.keys import JSON_ENCODING, GloveKeys, all_gloves, parse_glove_key
from glovecal_client.publishers import Publishers
from glovecal_client.run_metas import RunMetas
from glovecal_client.session import MAX_PUT_BYTES, ask, json_object
from glovecal_models.hand.rotations import Handedness
from glovecal_models.takes.take import KnownLatency
from glovecal_service.incoming.documents import Documents
from glovecal_service.incoming.frame_gate import TAKEOVER_AFTER_NS
from glovecal_service.realtime.glove_lanes import GLOVES_LIMIT, GlovePipeline
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
    delay_ms: int = 0
    """How long each pose waits for the frames after it, as somebody chose for the glove."""
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
            "delay_ms": self.delay_ms,
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
CHANGE_EVERY_S = 1.0
"""Of a glove without frames: each change has its model chosen anew."""
MOST_GLOVES = 2 * GLOVES_LIMIT

_log = logging.getLogger("glovecal.realtime")


class GloveMetas:
    """What each glove's run says of itself. For one thread; ``warnings`` may be asked by others.

    While a run's frames pass, the meta of that run is in force and no other; of a silent glove, that of the
    run heard of last. Nothing is heard of a glove that has neither frames nor a liveliness token.
    """

    def __init__(self, session: zenoh.Session, site: str, publishers: Publishers) -> None:
        self._session = session
        self._site = site
        self._publishers = publishers
        self._documents = Documents(session, site, "meta")
        self._lanes: dict[str, GlovePipeline] = {}
        self._runs_of: dict[str, RunMetas] = {}
        self._in_force: dict[str, dict[str, Any]] = {}
        self._asked_at: dict[str, float] = {}
        self._changed_at: dict[str, float] = {}

    def of(self, glove: str) -> dict[str, Any] | None:
        """The meta in force."""
        return self._in_force.get(glove)

    def is_proven(self, glove: str) -> bool:
        """Whether frames of the run whose meta is in force have passed; of a camera, whether it is there."""
        meta = self._in_force.get(glove)
        if meta is None:
            return False
        if meta.get("makes_poses") is True:
            return self._publishers.has(glove)
        return meta.get("run_id") == self._run_of(glove)

    def proven(self) -> set[str]:
        return set(filter(self.is_proven, self._in_force))

    def warnings(self, glove: str) -> list[dict[str, str]]:
        """That somebody else spoke for the run that is in force, as JSON."""
        metas = self._runs_of.get(glove)
        if metas is None or not metas.refused or metas.contradicted != self._run_of(glove):
            return []
        times = "once" if metas.refused == 1 else f"{metas.refused} times"
        sentence = f"{metas.sentence[0].upper()}{metas.sentence[1:]} ({times})."
        return [{"part": "publisher", "sentence": sentence, "advice": _STOP_ONE}]

    def forget(self, glove: str) -> None:
        """No longer remember when it was asked."""
        self._asked_at.pop(glove, None)

    def news(self, lanes: Iterable[GlovePipeline]) -> set[str]:
        """Gloves whose meta changed since the last call; a glove that streams without one is asked for it."""
        self._lanes = {lane.glove: lane for lane in lanes if lane.gate.run_id is not None}
        for document in self._documents.take(self._is_there):
            self._note(document.glove, document.content)
        for glove in [glove for glove in self._lanes if self._is_unknown(glove)]:
            self.ask(glove)
        return {glove for glove in self._runs_of if self._comes_into_force(glove)}

    def ask(self, glove: str = "*") -> None:
        """Ask one glove, or all, for its meta."""
        self._asked_at[glove] = time.monotonic()
        key = all_gloves(self._site, "meta") if glove == "*" else GloveKeys(self._site, glove).meta
        with suppress(NoAnswer):
            for answer in ask(self._session, key, timeout_s=_ANSWER_WITHIN_S):
                payload = answer.payload.to_bytes()
                meta = json_object(payload) if len(payload) <= MAX_PUT_BYTES else None
                with suppress(BadName):
                    self._note(parse_glove_key(str(answer.key_expr))[0].glove, meta or {})

    def _is_there(self, glove: str) -> bool:
        return glove in self._lanes or self._publishers.has(glove)

    def _run_of(self, glove: str) -> str:
        stream = self._lanes.get(glove)
        run_id = None if stream is None else stream.gate.run_id
        return "" if run_id is None else f"{run_id:016x}"

    def _is_unknown(self, glove: str) -> bool:
        metas = self._runs_of.get(glove)
        known = metas is not None and metas.of(self._run_of(glove)) is not None
        return not known and time.monotonic() - self._asked_at.get(glove, -ASK_EVERY_S) >= ASK_EVERY_S

    def _note(self, glove: str, meta: dict[str, Any]) -> None:
        if not meta or (glove not in self._runs_of and not self._has_room()):
            return
        metas = self._runs_of.setdefault(glove, RunMetas())
        is_first = metas.contradicted != meta.get("run_id")
        if not metas.note(meta, keep=self._run_of(glove)) and is_first:
            _log.warning("glove %s: %s. %s", glove, metas.sentence, _STOP_ONE)

    def _has_room(self) -> bool:
        if len(self._runs_of) >= MOST_GLOVES:
            for glove in [glove for glove in self._runs_of if not self._is_there(glove)]:
                del self._runs_of[glove]
                self._in_force.pop(glove, None)
                self._changed_at.pop(glove, None)
        return len(self._runs_of) < MOST_GLOVES

    def _comes_into_force(self, glove: str) -> bool:
        """Put the meta in force that belongs to the glove now; whether that changes anything."""
        metas, stream = self._runs_of[glove], self._lanes.get(glove)
        meta = metas.newest
        streams = stream is not None and clock_ns() - stream.valid_ns <= TAKEOVER_AFTER_NS
        if streams:
            meta = metas.of(self._run_of(glove))
        if meta is None or not _differs(meta, self._in_force.get(glove)):
            return False
        late_s = time.monotonic() - self._changed_at.get(glove, -CHANGE_EVERY_S)
        if late_s < CHANGE_EVERY_S and not streams:
            return False
        self._changed_at[glove] = time.monotonic()
        self._in_force[glove] = meta
        return True


_STOP_ONE = "Stop the other publisher, or give it a --glove name of its own."


def _differs(meta: dict[str, Any], earlier: dict[str, Any] | None) -> bool:
    if earlier is None:
        return True
    names = (set(meta) | set(earlier)).difference(_CHANGES_ALL_THE_TIME)
    return any(meta.get(name) != earlier.get(name) for name in names)
