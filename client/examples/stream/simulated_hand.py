"""A hand that is not there: publishes poses as the service does, over zenoh, marked as simulated.

Its errors are those of a calibrated glove as far as one number can say it: Gaussian with a standard deviation
that the poses state truly, correlated between joints (a shift of the whole glove) and over time.
"""

from __future__ import annotations

import hashlib
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager

import numpy as np
import zenoh

from glovecal_client import GloveKeys, Pose, PoseFlag, encode_pose, open_client, open_router
from glovecal_client.clock import wall_ns
from glovecal_models.hand.rotations import HAND_ROTATIONS

RATE_HZ = 60.0
SHARED = 0.3
"""Correlation of two joints' errors."""
CORRELATION_S = 0.5
"""Errors of two moments so far apart correlate by 1/e."""
Script = Callable[[float], Mapping[str, float]]
"""Angles in degrees by rotation, at a time in seconds from the start."""


class CorrelatedErrors:
    """Errors in degrees of one sensor after another, a first-order process in time."""

    def __init__(self, sd_deg: float, rotations: int, seed: int) -> None:
        self._sd, self._rng = sd_deg, np.random.default_rng(seed)
        self._state = self._draw(rotations)

    def next(self, step_s: float) -> np.ndarray:
        """(R,), ``step_s`` after those before."""
        kept = np.exp(-step_s / CORRELATION_S)
        self._state = kept * self._state + np.sqrt(1 - kept**2) * self._draw(len(self._state))
        return self._sd * self._state

    def _draw(self, rotations: int) -> np.ndarray:
        own, common = self._rng.normal(size=rotations), self._rng.normal()
        return np.sqrt(1 - SHARED) * own + np.sqrt(SHARED) * common


class SimulatedHand:
    """Publishes one pose after another of a script, and says the names of its rotations when asked."""

    def __init__(
        self, session: zenoh.Session, site: str, glove: str, script: Script, *, sd_deg: float = 0.0,
        stated_sd_deg: float | None = None, rotations: tuple[str, ...] = HAND_ROTATIONS, seed: int = 1,
        rate_hz: float = RATE_HZ,
    ) -> None:  # fmt: skip
        """``sd_deg``: of the errors; the poses state it unless ``stated_sd_deg`` is given."""
        self._session, self._keys, self._script = session, GloveKeys(site, glove), script
        self._names, self._errors = rotations, CorrelatedErrors(sd_deg, len(rotations), seed)
        stated = max(sd_deg, 0.5) if stated_sd_deg is None else stated_sd_deg
        self._deviations = np.full(len(rotations), stated, np.float32)
        self._model = hashlib.sha256("\n".join(rotations).encode()).hexdigest()
        self._run, self._sequence, self._rate_hz = wall_ns(), 0, rate_hz
        self._queryable = session.declare_queryable(self._keys.pose_meta, self._answer)

    def publish(self) -> float:
        """The next pose; returns its time in seconds from the start, which is that of the script."""
        seconds = self._sequence / self._rate_hz
        angles = self._script(seconds)
        degrees = np.array([angles[name] for name in self._names]) + self._errors.next(1 / self._rate_hz)
        time_ns = round(seconds * 1e9)
        pose = Pose(
            self._sequence, self._run, time_ns, time_ns, degrees.astype(np.float32), self._deviations,
            np.zeros(len(degrees), np.uint8), self._model, PoseFlag.SIMULATED,
        )  # fmt: skip
        self._session.put(self._keys.pose, encode_pose(pose))
        self._sequence += 1
        return seconds

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            query.reply(
                self._keys.pose_meta, json.dumps({"model": self._model, "rotations": list(self._names)})
            )

    def close(self) -> None:
        self._queryable.undeclare()


@contextmanager
def simulated_glove(site: str, glove: str, script: Script, sd_deg: float) -> Iterator[str]:
    """A router of its own on this machine with a hand that publishes in real time; gives its endpoint."""
    endpoint, stop = free_endpoint(), threading.Event()
    with ExitStack() as open_things:
        open_things.enter_context(open_router([endpoint]))
        session = open_things.enter_context(open_client([endpoint]))
        hand = SimulatedHand(session, site, glove, script, sd_deg=sd_deg)
        open_things.callback(hand.close)
        thread = threading.Thread(target=_run, args=(hand, stop), name="simulated hand", daemon=True)
        thread.start()
        try:
            yield endpoint
        finally:
            stop.set()
            thread.join()


def _run(hand: SimulatedHand, stop: threading.Event) -> None:
    start = time.monotonic()
    while not stop.is_set():
        stop.wait(max(0.0, start + hand.publish() - time.monotonic()))


def free_endpoint() -> str:
    """A tcp endpoint on 127.0.0.1 that nobody listens on."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{listener.getsockname()[1]}"
