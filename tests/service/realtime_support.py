"""For the tests of the real-time half: gloves on a real zenoh, processes of the service, a small model."""

from __future__ import annotations

import json
import multiprocessing
import os
import secrets
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from multiprocessing import forkserver, reduction
from multiprocessing.process import BaseProcess
from typing import TYPE_CHECKING, Any, TypeVar
from unittest.mock import patch

import numpy as np
import zenoh
from free_ports import free_endpoint as free_endpoint

from glovecal_client.capture.device import Reading
from glovecal_client.keys import GloveKeys, all_services
from glovecal_client.session import ask, ask_json, json_object
from glovecal_client.wire.frame import Frame, encode_frame
from glovecal_models.calibration.artifact import dump
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take
from glovecal_service.jobs.workers import CONFIG, IMPORTED_ONCE
from glovecal_service.operating_system import FORKS
from glovecal_service.rest.routes import MODULES
from glovecal_service.serve import Lifeline, Work, run_part
from glovecal_service.settings import Settings
from glovecal_service.store import Store

if TYPE_CHECKING:
    from multiprocessing.context import ForkServerContext, SpawnContext

LAYOUT = Layout.from_toml("""
name = "three-bends"
sensors = ["I_MCP", "I_PIP", "M_MCP"]
counts = [0, 255]
[rotations]
I_MCP = ["I_MCP"]
I_PIP = ["I_PIP"]
M_MCP = ["M_MCP", "I_MCP"]
""")

Value = TypeVar("Value")


def eventually(condition: Callable[[], Value | None], what: str, deadline_s: float = 240.0) -> Value:
    """The first true value of ``condition``; fails with ``what`` after the deadline."""
    end = time.monotonic() + deadline_s
    while not (value := condition()):
        assert time.monotonic() < end, f"did not happen in {deadline_s} s: {what}"
        time.sleep(0.02)
    return value


PARTS = [
    "glovecal_service.serve", "glovecal_service.realtime.process", "glovecal_service.recorder.recorder",
    "glovecal_service.rest.app", "glovecal_service.studio.mount",
    *(f"glovecal_service.rest.{name}" for name in MODULES),
]  # fmt: skip
_OF_WORKERS = "distributed.nanny.pre-spawn-environ."


@cache
def _context() -> ForkServerContext | SpawnContext:
    """Parts of the service are forked from a process that has imported what they need and opened no session,
    as ``glovecal serve`` forks them: a fresh interpreter imports for two to four seconds.

    A process has one to fork from: workers of jobs come from it, too, and find it as they want it.
    """
    if not FORKS:
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([*PARTS, *IMPORTED_ONCE])
    for_workers = {
        name.removeprefix(_OF_WORKERS): str(value)
        for name, value in CONFIG.items()
        if name.startswith(_OF_WORKERS)
    }
    with patch.dict(os.environ, for_workers):
        forkserver.ensure_running()
    return context


class _Stream:
    """A standard stream of the test: the forked process writes to it as well, so that pytest has it."""

    def __init__(self, number: int) -> None:
        self._number = number

    def __reduce__(self) -> tuple[Callable[..., None], tuple[Any, int]]:
        return _take_over, (reduction.DupFd(self._number), self._number)


def _take_over(sent: Any, number: int) -> None:
    arrived = sent.detach()
    os.dup2(arrived, number)
    os.close(arrived)


def _run(_streams: Any, work: Work, settings: Settings, ready: Any, lifeline: Lifeline) -> None:
    run_part(work, settings, ready, lifeline)


@contextmanager
def part_of_service(work: Work, settings: Settings) -> Iterator[BaseProcess]:
    """One of the service's processes, ready, as ``glovecal serve`` starts it."""
    context = _context()
    ready = context.Event()
    end, held = context.Pipe(duplex=False)
    streams = tuple(map(_Stream, (1, 2))) if FORKS else ()
    arguments = (streams, work, settings, ready, Lifeline(end, None))
    process = context.Process(target=_run, args=arguments)
    process.start()
    try:
        assert ready.wait(120), "the process did not get ready"
        yield process
    finally:
        held.close()
        process.join(60)
        if process.is_alive():
            process.kill()
            process.join()


def linear_model(subject: str, *, degrees_per_count: float) -> CalibrationModel:
    """A plane through made-up samples: I_MCP = degrees_per_count * (reading - 100), the others alike."""
    time_s = np.arange(200) / 100.0
    readings = np.random.default_rng(0).uniform(20.0, 230.0, (200, 3))
    reference = degrees_per_count * (readings - 100.0)
    take = Take("t", "w", LAYOUT.sensors, time_s, readings, LAYOUT.rotations, time_s, reference)
    return train([take], LAYOUT, subject, TrainingSettings(method="linear", folds=0))


def store_model(store: Store, subject: str, *, degrees_per_count: float, activate: bool = True) -> str:
    """Keep such a model under its subject; its id."""
    if subject not in [record.name for record in store.subjects.list()]:
        store.subjects.create(subject)
    model = linear_model(subject, degrees_per_count=degrees_per_count)
    record = store.models.add(
        dump(model), subject=subject, layout=LAYOUT.name, method="linear", parent=None, facts={}
    )
    if activate:
        store.models.activate(record.id)
    return record.id


class WireGlove:
    """A glove that publishes exactly what a test wants, good and bad."""

    def __init__(
        self, session: zenoh.Session, settings: Settings, glove: str, *, subject: str | None = None
    ) -> None:
        self.keys = GloveKeys(settings.site, glove)
        self.run_id = secrets.randbits(64)
        self.sequence = 0
        self.sent = 0
        self._session = session
        self._subject = subject
        self._token = session.liveliness().declare_token(self.keys.alive)
        # what a test sends arrives: a busy computer's full queue would drop it
        self._raw = session.declare_publisher(
            self.keys.raw, express=True, congestion_control=zenoh.CongestionControl.BLOCK
        )

    def say_meta(self, **changes: Any) -> None:
        self._session.put(self.keys.meta, json.dumps(self.meta() | changes))

    def answer_meta(self) -> zenoh.Queryable:
        """To whoever asks, as a capture daemon does."""

        def answer(query: zenoh.Query) -> None:
            with query:
                query.reply(self.keys.meta, json.dumps(self.meta()))

        return self._session.declare_queryable(self.keys.meta, answer)

    def meta(self) -> dict[str, Any]:
        return {
            "glove": self.keys.glove,
            "layout": LAYOUT.name,
            "sensors": list(LAYOUT.sensors),
            "context": [],
            "subject": self._subject,
            "wearing": "w",
            "simulated": False,
            "run_id": f"{self.run_id:016x}",
        }

    def restart(self) -> None:
        """As when its capture is started again: another run, which may say something else of itself."""
        self.run_id, self.sequence = secrets.randbits(64), 0

    def frame(self, readings: tuple[float, ...] = (120.0, 130.0, 140.0), **changes: Any) -> Frame:
        """The next frame, or a variation of it."""
        values = {
            "sequence": self.sequence,
            "run_id": self.run_id,
            "monotonic_ns": time.monotonic_ns(),
            "wall_ns": time.time_ns(),
            "readings": np.array(readings, np.float32),
        } | changes
        return Frame(**values)

    def send(self, readings: tuple[float, ...] = (120.0, 130.0, 140.0), **changes: Any) -> bytes:
        """Send one good frame, or a variation of it; the bytes sent."""
        message = encode_frame(self.frame(readings, **changes))
        self.send_bytes(message)
        self.sequence += 1
        return message

    def send_bytes(self, message: bytes) -> None:
        self.sent += 1
        self._raw.put(message)


def service_status(session: zenoh.Session, settings: Settings) -> dict[str, Any]:
    return ask_json(session, all_services(settings.site).removesuffix("alive") + "status")


def glove_status(session: zenoh.Session, settings: Settings, glove: str) -> dict[str, Any]:
    """By the process that has the glove."""
    key = all_services(settings.site).removesuffix("alive") + "status"
    told = (json_object(answer.payload.to_bytes()) or {} for answer in ask(session, key))
    return next((gloves[glove] for each in told if glove in (gloves := each["gloves"])), {})


class SteadyDevice:
    """A device of the capture daemon that gives a slow wave, ``rate_hz`` times a second."""

    def __init__(self, rate_hz: float = 200.0) -> None:
        self.name, self.layout, self.simulated, self.rate_hz = "steady", LAYOUT.name, True, rate_hz
        self.sensors, self.context = LAYOUT.sensors, ("supply_v",)
        self._due = 0.0

    @classmethod
    def from_options(cls, argument: str | None, options: Mapping[str, str]) -> SteadyDevice:
        return cls(float(argument or 200.0))

    def open(self) -> None:
        self._due = time.monotonic()

    def close(self) -> None:
        self._due = 0.0

    def read(self, timeout_s: float) -> Reading | None:
        self._due += 1.0 / self.rate_hz
        time.sleep(max(0.0, min(timeout_s, self._due - time.monotonic())))
        now = time.monotonic()
        readings = 128 + 90 * np.sin(now + np.arange(len(self.sensors)))
        supply = np.array([4.9], np.float32)
        return Reading(readings.astype(np.float32), time.monotonic_ns(), time.time_ns(), supply)
