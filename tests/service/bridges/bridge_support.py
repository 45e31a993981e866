"""Gloves on a real zenoh whose poses a test knows, and bridges as processes of the real command."""

from __future__ import annotations

import json
import re
import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import zenoh
from cli_running import Started, start
from realtime_support import eventually, free_endpoint

from glovecal_client.clock import clock_ns, computer_id, wall_ns
from glovecal_client.keys import GloveKeys
from glovecal_client.session import open_client, open_router
from glovecal_client.wire.pose import Pose, PoseFlag, encode_pose
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.rotations import HAND_ROTATIONS, Handedness
from glovecal_models.hand.skeleton import hand_skeleton, skeleton_document

SITE = "lab"
SIZES = HandDimensions.from_measured({"hand_length": 182.0, "hand_breadth": 80.0})
FIST = {"I_MCP": 80.0, "I_PIP": 95.0, "M_MCP": 85.0, "M_PIP": 90.0, "R_MCP": 70.0, "R_PIP": 85.0,
        "P_MCP": 60.0, "P_PIP": 75.0, "T_MCP": 40.0, "T_IP": 55.0}  # fmt: skip
FLAT = dict.fromkeys(HAND_ROTATIONS, 0.0)


class WornHand:
    """A glove that publishes whole poses, as the service does for a calibrated one."""

    def __init__(self, session: zenoh.Session, glove: str, hand: Handedness) -> None:
        self.glove = glove
        self.hand: Handedness = hand
        self.keys = GloveKeys(SITE, glove)
        self.skeleton = hand_skeleton(SIZES, hand)
        self.rotations, self.is_hand_known = HAND_ROTATIONS, True
        self.model: str | None = ("aa" if hand == "left" else "bb") * 32
        self.run_id, self.sequence = 7 if hand == "left" else 8, 0
        self._session, self._lock = session, threading.Lock()
        self._queryables = [
            session.declare_queryable(self.keys.pose_meta, lambda query: self._answer(query, self.meta)),
            session.declare_queryable(self.keys.meta, lambda query: self._answer(query, self.glove_meta)),
        ]

    @property
    def meta(self) -> dict[str, Any]:
        calibrated = self.model is not None
        return {
            "glove": self.glove,
            "state": "calibrated" if calibrated else "uncalibrated",
            "model": self.model,
            "rotations": list(self.rotations) if calibrated else [],
            "hand": self.hand if self.is_hand_known else "unknown",
            "skeleton": skeleton_document(self.skeleton) if self.is_hand_known else None,
        }

    @property
    def glove_meta(self) -> dict[str, Any]:
        return {"glove": self.glove, "computer": computer_id(), "hand": self.hand}

    def put(
        self, angles: Mapping[str, float] | None = None, *, flags: int = 0,
        rotation_flags: Mapping[str, int] | None = None, time_ns: int | None = None,
    ) -> Pose:  # fmt: skip
        """The next pose: ``angles`` in degrees over a flat hand. Uncalibrated while there is no model."""
        with self._lock:
            names = self.rotations if self.model is not None else ()
            degrees = np.array([{**FLAT, **(angles or {})}[name] for name in names], np.float32)
            marks = np.array([(rotation_flags or {}).get(name, 0) for name in names], np.uint8)
            monotonic_ns = clock_ns() if time_ns is None else time_ns
            pose = Pose(
                self.sequence, self.run_id, monotonic_ns, wall_ns(), degrees, np.ones_like(degrees), marks,
                self.model, flags if self.model else flags | PoseFlag.UNCALIBRATED, age_us=800,
            )  # fmt: skip
            self._session.put(self.keys.pose, encode_pose(pose), express=True)
            self.sequence += 1
            return pose

    def _answer(self, query: zenoh.Query, document: dict[str, Any]) -> None:
        with query:
            query.reply(query.key_expr, json.dumps(document))


class _Stream(threading.Thread):
    """Puts one and the same posture again and again, so that whoever connects late sees it."""

    def __init__(self, hands: tuple[WornHand, ...], rate_hz: float, postures: dict[str, Any]) -> None:
        super().__init__(name="poses", daemon=True)
        self._hands, self._period_s, self.postures = hands, 1 / rate_hz, postures
        self._is_over = threading.Event()

    def run(self) -> None:
        while not self._is_over.wait(self._period_s):
            for hand in self._hands:
                posture = self.postures.get(hand.hand)
                if posture is not None:
                    hand.put(**posture)

    def stop(self) -> None:
        self._is_over.set()
        self.join()


@dataclass
class Stage:
    endpoint: str
    right: WornHand
    left: WornHand
    postures: dict[str, Any] = field(default_factory=dict)
    """By hand: arguments of ``WornHand.put``; a glove without one is silent."""

    def show(self, **postures: Mapping[str, Any] | None) -> None:
        """From now on both are put with these arguments; None: silent."""
        self.postures.update(postures)

    @property
    def hands(self) -> tuple[WornHand, WornHand]:
        return self.right, self.left


@contextmanager
def open_stage(rate_hz: float = 60.0, suffix: str = "") -> Iterator[Stage]:
    """Gloves ``right`` and ``left``, with ``suffix`` where whole computers share their names."""
    endpoint = free_endpoint()
    with ExitStack() as opened:
        opened.enter_context(open_router([endpoint]))
        session = opened.enter_context(open_client([endpoint]))
        right, left = WornHand(session, f"right{suffix}", "right"), WornHand(session, f"left{suffix}", "left")
        stage = Stage(endpoint, right, left)
        stream = _Stream(stage.hands, rate_hz, stage.postures)
        stream.start()
        opened.callback(stream.stop)
        yield stage


class RunningBridge:
    """``glovecal bridge NAME --json`` as a process."""

    def __init__(self, process: Started) -> None:
        self.process = process
        self.lines: list[dict[str, Any]] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(json.loads(line))

    @property
    def complaints(self) -> str:
        """Standard error so far."""
        return self.process.so_far

    def place(self) -> tuple[str, int]:
        """Host and port on which it listens, or to which it sends."""
        found = eventually(lambda: re.search(r"([\w.]+):(\d+)", self.complaints), "the bridge says where")
        return found[1], int(found[2])

    def counts(self, glove: str) -> dict[str, Any]:
        """The newest line's, {} before the first."""
        return self.lines[-1]["gloves"].get(glove, {}) if self.lines and "gloves" in self.lines[-1] else {}

    def end(self) -> dict[str, Any]:
        """As Ctrl-C; the summary."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(60)
            self._reader.join(60)
        finally:
            self.process.kill()
            _, complaints = self.process.communicate()
        assert self.process.returncode == 0, complaints
        assert "Traceback" not in complaints, complaints
        return self.lines[-1]["summary"]


@contextmanager
def running_bridge(service: Stage | str, name: str, *options: object) -> Iterator[RunningBridge]:
    """Until the block ends; it must end cleanly. ``service``: a stage, or the endpoint of a router."""
    endpoint = service if isinstance(service, str) else service.endpoint
    process = start({"GLOVECAL_ZENOH": endpoint}, "bridge", name, "--json", *options)
    bridge = RunningBridge(process)
    try:
        yield bridge
    finally:
        if process.returncode is None:
            bridge.end()


def refused(stage: Stage, *arguments: object) -> str:
    """What ``glovecal bridge`` says that refuses ``arguments``, in one line."""
    process = start({"GLOVECAL_ZENOH": stage.endpoint}, "bridge", *arguments)
    try:
        _, complaints = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 1, complaints
    return " ".join(complaints.split())
