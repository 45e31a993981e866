"""What a glove's poses mean, as JSON on ``glovecal/<site>/<glove>/pose/meta``: on change and to queries."""

from __future__ import annotations

import json
from dataclasses import dataclass
from threading import Lock
from typing import Any

import zenoh

from glovecal_client.keys import JSON_ENCODING, GloveKeys, all_gloves
from glovecal_models.takes.known_latency import KnownLatency
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
