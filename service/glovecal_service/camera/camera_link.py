"""A camera's side of the wire: poses like any glove's, and what it says of itself.

Pictures go on while there is no router; poses then reach nobody.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import Any

import zenoh

from glovecal_client.capture.other_publisher import describe_publisher, other_publisher
from glovecal_client.errors import CaptureRefused, ClientError, NoAnswer
from glovecal_client.keys import JSON_ENCODING, GloveKeys
from glovecal_client.queries import REFUSAL_ENCODING, json_object
from glovecal_client.session import open_client
from glovecal_client.wire.pose import POSE_ENCODING
from glovecal_models.errors import GlovecalError
from glovecal_service.plain import reason_of

RETRY_S = 1.0
PICTURE_ENCODING = "image/jpeg"

Document = Callable[[], dict[str, Any]]


@dataclass(frozen=True)
class CameraAnswers:
    """Where answers come from; called from zenoh's threads."""

    status: Document
    meta: Document
    pose_meta: Document
    command: Callable[[str, str], Mapping[str, Any]]
    """Name and argument; raises GlovecalError with a sentence."""
    picture: Callable[[Mapping[str, str]], bytes]
    """A JPEG by the parameters of the query; raises GlovecalError."""


class CameraLink:
    """One zenoh session; ``refusal`` says why this camera must give way to another publisher."""

    def __init__(
        self, keys: GloveKeys, endpoint: str, run: tuple[int, int], answers: CameraAnswers,
        report: Callable[[str], None],
    ) -> None:  # fmt: skip
        """``run``: when it started by the wall clock, and its run id."""
        self.refusal: str | None = None
        self._keys, self._endpoint, self._run = keys, endpoint, run
        self._answers, self._report = answers, report
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._keep_trying, name="camera link", daemon=True)
        self._open = ExitStack()
        self._poses: zenoh.Publisher | None = None
        self._session: zenoh.Session | None = None

    def start(self) -> None:
        """Connect as soon as there is a router."""
        self._thread.start()

    def publish_pose(self, message: bytes) -> None:
        """Dropped rather than waited for, and while there is no router."""
        publisher = self._poses
        if publisher is not None:
            with suppress(zenoh.ZError):
                publisher.put(message)

    def publish_status(self) -> None:
        self._put(self._keys.status, self._answers.status)

    def publish_metas(self) -> None:
        """What this camera is, and what its poses' numbers are."""
        self._put(self._keys.meta, self._answers.meta)
        self._put(self._keys.pose_meta, self._answers.pose_meta)

    def close(self) -> None:
        """What was put before is still sent."""
        self._stop.set()
        self._thread.join()
        self._poses = self._session = None
        self._open.close()

    def _put(self, key: str, document: Document) -> None:
        session = self._session
        if session is not None:
            with suppress(zenoh.ZError):
                session.put(key, json.dumps(document(), allow_nan=False), encoding=JSON_ENCODING)

    def _keep_trying(self) -> None:
        while not self._stop.is_set() and self.refusal is None:
            try:
                self._connect()
                return
            except CaptureRefused as error:
                self.refusal = str(error)
            except (ClientError, zenoh.ZError) as error:
                if not self._stop.is_set():
                    self._report(f"poses reach nobody: {reason_of(error)}")
                self._stop.wait(RETRY_S)

    def _connect(self) -> None:
        with ExitStack() as opened:
            try:
                session = opened.enter_context(open_client((self._endpoint,), wait_s=0.0))
            except NoAnswer:
                self._report(f"no router at {self._endpoint} yet: poses reach nobody until there is one")
                session = opened.enter_context(
                    open_client((self._endpoint,), wait_s=None, cancelled=self._stop.is_set)
                )
            other = other_publisher(session, self._keys, self._stop.is_set)
            if other is not None:
                raise CaptureRefused(other)
            self._declare(session, opened)
            self._open = opened.pop_all()
        self._report(f"publishing to {self._keys.pose}")

    def _declare(self, session: zenoh.Session, opened: ExitStack) -> None:
        keys = self._keys
        opened.enter_context(session.liveliness().declare_token(keys.alive))
        watch = zenoh.handlers.Callback(self._hear_status, indirect=True)
        opened.enter_context(
            session.declare_subscriber(keys.status, watch, allowed_origin=zenoh.Locality.REMOTE)
        )
        for key, document in (
            (keys.status, self._answers.status),
            (keys.meta, self._answers.meta),
            (keys.pose_meta, self._answers.pose_meta),
        ):
            opened.enter_context(session.declare_queryable(key, _answering(key, document)))
        opened.enter_context(session.declare_queryable(keys.control, self._carry_out))
        opened.enter_context(session.declare_queryable(keys.picture, self._show))
        self._session = session
        self._poses = session.declare_publisher(
            keys.pose,
            encoding=POSE_ENCODING,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.INTERACTIVE_HIGH,
        )
        self.publish_metas()
        self.publish_status()

    def _carry_out(self, query: zenoh.Query) -> None:
        with query:
            asked = query.parameters
            try:
                answer = self._answers.command(str(asked.get("do", "")), str(asked.get("with", "")))
            except (GlovecalError, ClientError) as error:
                query.reply_err(str(error), encoding=REFUSAL_ENCODING)
            else:
                query.reply(self._keys.control, json.dumps(dict(answer)), encoding=JSON_ENCODING)

    def _show(self, query: zenoh.Query) -> None:
        with query:
            asked = {name: str(query.parameters.get(name, "")) for name in ("layers", "width")}
            try:
                picture = self._answers.picture(asked)
            except (GlovecalError, ClientError) as error:
                query.reply_err(str(error), encoding=REFUSAL_ENCODING)
            else:
                query.reply(self._keys.picture, picture, encoding=PICTURE_ENCODING)

    def _hear_status(self, sample: zenoh.Sample) -> None:
        """Two that started while the router was away meet here; the later one gives way."""
        other = json_object(sample.payload.to_bytes())
        if other is None or other.get("state") == "stopped":
            return
        try:
            run_id, started = int(str(other["run_id"]), 16), int(other["started_wall_ns"])
        except (KeyError, ValueError, TypeError):
            return
        if run_id != self._run[1] and (started, run_id) < self._run:
            self.refusal = describe_publisher(self._keys, other)


def _answering(key: str, document: Document) -> Callable[[zenoh.Query], None]:
    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(key, json.dumps(document(), allow_nan=False), encoding=JSON_ENCODING)

    return answer
