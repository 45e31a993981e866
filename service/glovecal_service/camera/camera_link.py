"""A camera's side of the wire: poses like any glove's, and what it says of itself and how it does.

Pictures go on while there is no router; poses then reach nobody.
"""

from __future__ import annotations

import json
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import zenoh

from glovecal_client.capture.link import describe_publisher, other_publisher
from glovecal_client.errors import CaptureRefused, ClientError, NoAnswer
from glovecal_client.keys import JSON_ENCODING, GloveKeys
from glovecal_client.session import REFUSAL_ENCODING, json_object, open_client
from glovecal_client.wire.pose import POSE_ENCODING
from glovecal_models.colour_glove.hand_state import FINGER_ROTATIONS, PoseEstimate
from glovecal_models.colour_glove.pictures.picture_check import light_advice
from glovecal_models.errors import GlovecalError
from glovecal_service.plain import reason_of

LAST_POSES = 300
"""Over which latencies and shares are told: 10 s at 30 Hz."""
LAST_LIGHT = 40
"""Pictures checked over which the light is judged: a hand in one pose may shade itself."""
SILENT_AFTER_S = 2.0
Sees = str
NOTHING_YET, HAND, NO_HAND = "nothing yet", "hand", "no hand"


class CameraHealth:
    """Written by the thread that tracks, read by others through ``document``."""

    def __init__(self) -> None:
        self.tracked = self.without_hand = self.unusable = 0
        self.sees: Sees = NOTHING_YET
        self.problem = ""
        """Why the last picture could not be used; empty where it could."""
        self.findings: Counter[str] = Counter()
        """Pictures checked in which each kind was found."""
        self.present: dict[str, str] = {}
        """Sentences of the newest picture that was checked, by kind."""
        self._shadowed: deque[float] = deque(maxlen=LAST_LIGHT)
        self._lock = threading.Lock()
        self._latencies_ms: deque[float] = deque(maxlen=LAST_POSES)
        self._spent_ms: deque[float] = deque(maxlen=LAST_POSES)
        self._poses_at: deque[float] = deque(maxlen=LAST_POSES)
        self._accepted: deque[np.ndarray] = deque(maxlen=LAST_POSES)
        self._disagreeing: deque[float] = deque(maxlen=LAST_POSES)
        self._newest: PoseEstimate | None = None

    @property
    def decided(self) -> int:
        """Pictures that were taken and dealt with."""
        return self.tracked + self.without_hand + self.unusable

    def forget_poses(self) -> None:
        """What latencies and shares are told from begins anew."""
        with self._lock:
            self._forget_poses()

    def _forget_poses(self) -> None:
        for each in (
            self._latencies_ms, self._spent_ms, self._poses_at, self._accepted, self._disagreeing
        ):  # fmt: skip
            each.clear()

    def note_findings(self, found: Mapping[str, str]) -> None:
        """Sentences by kind."""
        with self._lock:
            self.present = dict(found)
            self.findings.update(self.present.keys())

    def note_light(self, shadowed: float | None) -> None:
        """Share of the glove, of one more picture."""
        if shadowed is not None:
            with self._lock:
                self._shadowed.append(shadowed)

    def note_pose(self, estimate: PoseEstimate, latency_ms: float, spent_ms: float) -> None:
        """``latency_ms`` from the picture's stamp to publication, ``spent_ms`` of it on labels and pose."""
        with self._lock:
            if self._newest is not None and estimate.stage != self._newest.stage:
                self._forget_poses()
            self.tracked += 1
            self.sees, self.problem = HAND, ""
            self._latencies_ms.append(latency_ms)
            self._spent_ms.append(spent_ms)
            self._poses_at.append(time.monotonic())
            self._accepted.append(estimate.accepted)
            self._disagreeing.append(estimate.disagreeing)
            self._newest = estimate

    def note_no_hand(self) -> None:
        with self._lock:
            self.without_hand += 1
            self.sees, self.problem = NO_HAND, ""

    def note_unusable(self, problem: str) -> None:
        with self._lock:
            self.unusable += 1
            self.problem = problem

    def document(self) -> dict[str, Any]:
        """Part of the status: counts, latencies in milliseconds, shares of the last poses."""
        with self._lock:
            newest = self._newest if self.sees == HAND else None
            accepted = np.array(self._accepted, dtype=bool).reshape(-1, len(FINGER_ROTATIONS))
            share = accepted.mean(axis=0) if len(accepted) else np.zeros(len(FINGER_ROTATIONS))
            return {
                "sees": self.sees,
                "problem": self.problem,
                "tracked": self.tracked,
                "without_hand": self.without_hand,
                "unusable": self.unusable,
                "findings": dict(self.present),
                "findings_counted": dict(self.findings),
                "advice": light_advice(self._shadowed),
                "pose_rate_hz": self._pose_rate_hz(),
                "latency_ms": _percentiles(self._latencies_ms),
                "computing_ms": _percentiles(self._spent_ms),
                "accepted_share": round(float(share.mean()), 3) if len(accepted) else None,
                "disagreeing": round(float(np.mean(self._disagreeing)), 3) if self._disagreeing else None,
                "position_mm": None if newest is None else newest.state.position_mm.round(1).tolist(),
                "position_sd_mm": None
                if newest is None
                else newest.standard_deviation[23:].round(1).tolist(),
                "patches": None if newest is None else list(newest.patches),
                "rotations": [] if newest is None else _rotations(newest, share),
            }

    def _pose_rate_hz(self) -> float:
        times = self._poses_at
        if len(times) < 2 or time.monotonic() - times[-1] > SILENT_AFTER_S:
            return 0.0
        return round((len(times) - 1) / max(times[-1] - times[0], 1e-9), 2)


def _rotations(estimate: PoseEstimate, share: np.ndarray) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "degrees": round(float(degrees), 2),
            "sd_deg": round(float(sd), 2),
            "accepted": bool(accepted),
            "accepted_share": round(float(often), 3),
        }
        for name, degrees, sd, accepted, often in zip(
            FINGER_ROTATIONS, estimate.state.angles_deg, estimate.standard_deviation[:20],
            estimate.accepted, share, strict=True,
        )
    ]  # fmt: skip


def _percentiles(values: deque[float]) -> dict[str, float] | None:
    if not values:
        return None
    half, most, worst = np.percentile(np.array(values), (50, 95, 100))
    return {"p50": round(half, 2), "p95": round(most, 2), "max": round(worst, 2)}


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
