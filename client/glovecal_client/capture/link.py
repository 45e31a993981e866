"""The daemon's side of the wire: connects when the router is there, publishes, answers queries.

Recording never waits for it: while there is no router, or another capture has the glove's name, ``publish``
does nothing and the log has the frames. It is tried again and again. Two publishers on one key would mix two
streams, so it asks first whether somebody else is publishing this glove.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass

import zenoh

from glovecal_client.capture.log_folder import LogQueries
from glovecal_client.errors import CaptureRefused, ClientError, NoAnswer, reason_of
from glovecal_client.keys import JSON_ENCODING, GloveKeys
from glovecal_client.session import REFUSAL_ENCODING, ask_json, json_object, open_client
from glovecal_client.wire.frame import FRAME_ENCODING

PATIENCE_S = 12.0
"""A publisher that died with its computer keeps its liveliness token until zenoh's lease of 10 s ends."""


def other_publisher(
    session: zenoh.Session,
    keys: GloveKeys,
    cancelled: Callable[[], bool],
    *,
    patience_s: float = PATIENCE_S,
) -> str | None:
    """A sentence naming the publisher that has the glove, None if it is free.

    A token whose owner answers is believed at once; a silent one must outlive the lease.
    """
    deadline = time.monotonic() + patience_s
    while _token_present(session, keys):
        try:
            meta = ask_json(session, keys.meta, timeout_s=1.0)
        except NoAnswer:
            if time.monotonic() >= deadline or cancelled():
                return (
                    f"glove {keys.glove!r} at site {keys.site!r} is held by a publisher that does not answer"
                )
            time.sleep(0.2)
        else:
            return describe_publisher(keys, meta)
    return None


def describe_publisher(keys: GloveKeys, meta: dict[str, object]) -> str:
    """The sentence for a publisher that sent this meta or status."""
    device = f" with device {meta['device']!r}" if "device" in meta else ""
    run = str(meta.get("run_id"))[:16]
    return (
        f"glove {keys.glove!r} at site {keys.site!r} is already published by run {run}{device};"
        " stop that capture or give this one another --glove name"
    )


def _token_present(session: zenoh.Session, keys: GloveKeys) -> bool:
    return any(reply.ok is not None for reply in session.liveliness().get(keys.alive, timeout=2.0))


_RETRY_S = 1.0
_MOST_EMPTY_CLAIMS = 64
_OTHER_RETRY_S = 2.0
"""After another publisher was found: it is asked whether it is still there."""


@dataclass(frozen=True)
class LinkSources:
    """Where the link gets its answers from; called from zenoh's threads."""

    status: Callable[[], str]
    meta: Callable[[], str]
    log: LogQueries
    command: Callable[[zenoh.Query], None]
    """Has a command carried out and answers it, later and from another thread."""


class CaptureLink:
    """One zenoh session with everything a glove publishes."""

    def __init__(
        self,
        keys: GloveKeys,
        endpoints: tuple[str, ...],
        run: tuple[int, int],
        sources: LinkSources,
        report: Callable[[str], None],
    ) -> None:
        self._keys = keys
        self._endpoints = endpoints
        self._run = run
        self._sources = sources
        self._report = report
        self._stop = threading.Event()
        self._wake = threading.Event()
        """There is something to do: to stop, or to give way."""
        self._thread: threading.Thread | None = None
        self._stopped: Callable[[], bool] = self._stop.is_set
        self._claim: tuple[int, str] | None = None
        """Run id of another publisher whose status was heard, and a sentence about it."""
        self._empty_claims: set[int] = set()
        """Runs whose publisher was not there when it was looked for: a status alone is no publisher."""
        self._told = ""
        self._putting = threading.Lock()
        self._put_problem: str | None = None
        self._served = ""
        self._open = ExitStack()
        self._frames: zenoh.Publisher | None = None
        self._documents: dict[str, zenoh.Publisher] = {}

    @property
    def connected(self) -> bool:
        """Whether frames go out."""
        return self._frames is not None

    def start(self, stopped: Callable[[], bool]) -> None:
        """Try once now, go on in a thread. Raises CaptureRefused where another publisher is there already.

        ``stopped`` ends the waiting for another publisher's token to go.
        """
        self._stopped = stopped
        try:
            self._connect(wait_s=0.0)
        except NoAnswer as error:
            self._tell(str(error))
        self._thread = threading.Thread(target=self._keep_publishing, name="capture link", daemon=True)
        self._thread.start()

    def _keep_publishing(self) -> None:
        while not self._stop.is_set():
            if self.connected:
                self._wake.wait()
                self._wake.clear()
                self._give_way()
                continue
            try:
                self._connect(wait_s=None)
            except CaptureRefused as error:
                self._tell(str(error))
                self._claim = None
                self._stop.wait(_OTHER_RETRY_S)
            except (ClientError, zenoh.ZError) as error:
                self._tell(reason_of(error))
                self._stop.wait(_RETRY_S)

    def _tell(self, why: str) -> None:
        """Why nothing is published: once, not at each attempt."""
        if why != self._told:
            self._told = why
            self._report(f"recording without publishing: {why}")

    def _give_way(self) -> None:
        """To the publisher that was heard, if any; whether it is really there shows at the next attempt."""
        if self._claim is not None and not self._stop.is_set():
            self._tell(self._claim[1])
            self._disconnect()

    def _disconnect(self) -> None:
        with self._putting:
            self._frames, self._documents = None, {}
        self._open.close()

    def _connect(self, wait_s: float | None) -> None:
        with ExitStack() as opened:
            session = opened.enter_context(
                open_client(self._endpoints, wait_s=wait_s, cancelled=self._is_stopping)
            )
            other = other_publisher(session, self._keys, self._is_stopping)
            if other is not None:
                raise CaptureRefused(other)
            if self._claim is not None:
                if len(self._empty_claims) >= _MOST_EMPTY_CLAIMS:
                    self._empty_claims.clear()
                self._empty_claims.add(self._claim[0])
                self._claim = None
            self._declare(session, opened)
            self._open = opened.pop_all()
        self._told = ""
        self._report(f"publishing to {self._keys.raw}")

    def _is_stopping(self) -> bool:
        return self._stop.is_set() or self._stopped()

    def _declare(self, session: zenoh.Session, opened: ExitStack) -> None:
        keys = self._keys
        opened.enter_context(session.liveliness().declare_token(keys.alive))
        watch = zenoh.handlers.Callback(self._hear_status, indirect=True)
        opened.enter_context(
            session.declare_subscriber(keys.status, watch, allowed_origin=zenoh.Locality.REMOTE)
        )
        served = zenoh.handlers.Callback(self._hear_pose_meta, indirect=True)
        opened.enter_context(session.declare_subscriber(keys.pose_meta, served))
        answers: dict[str, Callable[[zenoh.Query], None]] = {
            keys.status: self._answer_status,
            keys.meta: self._answer_meta,
            keys.log: self._answer_log,
        }
        answers[keys.control] = self._sources.command
        for key, answer in answers.items():
            opened.enter_context(session.declare_queryable(key, answer))
        for key in (keys.status, keys.meta):
            self._documents[key] = session.declare_publisher(key, encoding=JSON_ENCODING)
        self._frames = session.declare_publisher(
            keys.raw,
            encoding=FRAME_ENCODING,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.INTERACTIVE_HIGH,
            express=True,
        )
        self.publish_meta()

    def publish(self, message: bytes) -> None:
        """Send one frame, or nothing while that cannot be. Never blocks, never raises for the wire."""
        with self._putting:
            self._put(self._frames, message)

    def publish_status(self) -> None:
        """Send the status of this moment."""
        self._publish_document(self._keys.status, self._sources.status)

    def publish_meta(self) -> None:
        """Send the meta of this moment."""
        self._publish_document(self._keys.meta, self._sources.meta)

    def _publish_document(self, key: str, text: Callable[[], str]) -> None:
        if key in self._documents:
            payload = text()
            with self._putting:
                self._put(self._documents.get(key), payload)

    def _put(self, publisher: zenoh.Publisher | None, payload: bytes | str) -> None:
        """Put; a failure is told once, not once a frame."""
        if publisher is None:
            return
        problem = None
        try:
            publisher.put(payload)
        except zenoh.ZError:
            problem = "publishing fails: the router does not take frames"
        if problem != self._put_problem:
            self._put_problem = problem
            self._report(problem or "publishing works again")

    def close(self) -> None:
        """Stop trying, close the session. What was put before is still sent."""
        self._stop.set()
        self._wake.set()
        if self._thread is not None:
            self._thread.join()
        self._disconnect()

    def _answer_status(self, query: zenoh.Query) -> None:
        with query:
            query.reply(self._keys.status, self._sources.status(), encoding=JSON_ENCODING)

    def _answer_meta(self, query: zenoh.Query) -> None:
        with query:
            query.reply(self._keys.meta, self._sources.meta(), encoding=JSON_ENCODING)

    def _answer_log(self, query: zenoh.Query) -> None:
        with query:
            try:
                found = self._sources.log.answer(str(query.parameters))
            except (ClientError, OSError) as error:
                query.reply_err(reason_of(error), encoding=REFUSAL_ENCODING)
            else:
                query.reply(self._keys.log, found)

    def _hear_pose_meta(self, sample: zenoh.Sample) -> None:
        """How the service serves this run: once a change, what the person at the glove has to know."""
        document = json_object(sample.payload.to_bytes()) or {}
        if document.get("run_id") != f"{self._run[1]:016x}":
            return
        model, sentence = document.get("model"), str(document.get("sentence") or "")
        told = sentence if model is None else "; ".join(filter(None, [f"model {model:.12}", sentence]))
        served = f"poses: {'without a model' if model is None else 'calibrated'}; {told}"
        if served != self._served:
            self._served = served
            self._report(served)

    def _hear_status(self, sample: zenoh.Sample) -> None:
        """Two captures that started while the router was away meet here; the later one gives way.

        It goes on recording, and publishes again once the other is gone.
        """
        other = json_object(sample.payload.to_bytes())
        if other is None or other.get("state") == "stopped":
            return
        try:
            run_id, started = int(str(other["run_id"]), 16), int(other["started_wall_ns"])
        except (KeyError, ValueError, TypeError):
            return
        mine = self._run
        if run_id != mine[1] and (started, run_id) < mine and run_id not in self._empty_claims:
            self._claim = run_id, describe_publisher(self._keys, other)
            self._wake.set()
