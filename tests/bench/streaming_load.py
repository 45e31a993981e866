"""What loads the real-time process in the streaming bench, and what is measured of it from outside.

``drive`` is one process that stands for all gloves and for all animation tools, written to cost little:
frames are patched into ready-made messages and put in batches each millisecond, poses are only looked into.
"""

from __future__ import annotations

import gc
import json
import os
import secrets
import signal
import struct
import time
import zlib
from array import array
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np
import zenoh

from glovecal_client.errors import NoAnswer
from glovecal_client.keys import GloveKeys, all_gloves
from glovecal_client.session import ask_json, open_client
from glovecal_client.wire.frame import Frame, encode_frame
from glovecal_client.wire.pose import PoseFlag
from glovecal_models.layout import Layout

TICK_S = 0.001
_SEQUENCE_AND_TIMES = struct.Struct("<Qqq")
_AT = 8
_CHECKSUM = struct.Struct("<I")
_POSE_FLAGS_AT, _POSE_TIME, _POSE_AGE = 5, struct.Struct("<q"), struct.Struct("<I")
_POSE_TIME_AT, _POSE_AGE_AT = 16, 48
_STALE = int(PoseFlag.STALE)


@dataclass(frozen=True)
class Load:
    """Gloves that stream at one rate; glove number i is worn by person number i modulo ``people``."""

    endpoint: str
    site: str
    gloves: int
    people: int
    rate_hz: float
    seconds: float
    members: tuple[str, str] | None = None
    """Files of the members of a site that send frames and hear poses."""


def drive(pipe: Any, load: Load) -> None:
    """Connect, wait for models, say "ready"; then, as told: "start" streams, and sends how many were sent;
    "enough" sends what came since the last time it was told so. Ends when nobody tells any more.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with _session(load, 0) as session, _session(load, 1) as hearing:
        gloves = [GloveKeys(load.site, f"glove{number}") for number in range(load.gloves)]
        messages = [_Messages(number) for number in range(load.gloves)]
        watch = _Watch()
        subscriber = hearing.declare_subscriber(
            all_gloves(load.site, "pose"), zenoh.handlers.Callback(watch.hear)
        )
        sent = _stream_until_calibrated(load, session, hearing, gloves, messages)
        publishers = [
            session.declare_publisher(keys.raw, priority=zenoh.Priority.INTERACTIVE_HIGH) for keys in gloves
        ]
        gc.disable()
        pipe.send("ready")
        with suppress(EOFError):
            while True:
                if pipe.recv() == "start":
                    sent += _stream(load, publishers, messages, sent)
                    pipe.send(sent)
                else:
                    pipe.send((np.array(watch.latency_ns) / 1e6, np.array(watch.age_us) / 1e3))
                    watch.forget()
        subscriber.undeclare()


@contextmanager
def _session(load: Load, member: int) -> Iterator[zenoh.Session]:
    if load.members is not None:
        os.environ["GLOVECAL_SITE_FILE"] = load.members[member]
    with open_client([load.endpoint]) as session:
        yield session


def _stream(load: Load, publishers: list[zenoh.Publisher], messages: list[_Messages], before: int) -> int:
    """Frames at even spacing over all gloves, put as they fall due; how many were sent.

    ``before``: how many were sent earlier.
    """
    per_second, count = load.rate_hz * len(publishers), len(publishers)
    total, sent = int(per_second * load.seconds), 0
    start = time.monotonic()
    while sent < total:
        due = min(int((time.monotonic() - start) * per_second), total)
        for number in range(before + sent, before + due):
            sequence, glove = divmod(number, count)
            publishers[glove].put(messages[glove].message(sequence))
        sent = due
        time.sleep(TICK_S)
    time.sleep(0.5)
    return sent


class _Messages:
    """Frames of one glove without a call of the encoder for each: another number, time and checksum."""

    def __init__(self, number: int) -> None:
        self._number = number
        self._layout = Layout.built_in("cyberglove18")
        self._run_id = secrets.randbits(64)
        readings = np.random.default_rng(number).uniform(60, 190, (16, len(self._layout.sensors)))
        self._ready = [
            bytearray(encode_frame(Frame(0, self._run_id, 0, 0, row))[:-4]) for row in readings.astype("<f4")
        ]

    def message(self, sequence: int) -> bytes:
        body = self._ready[sequence % len(self._ready)]
        _SEQUENCE_AND_TIMES.pack_into(body, _AT, sequence, time.monotonic_ns(), time.time_ns())
        return bytes(body) + _CHECKSUM.pack(zlib.crc32(body))

    def meta(self, people: int) -> dict[str, Any]:
        return {
            "layout": self._layout.name,
            "sensors": list(self._layout.sensors),
            "context": [],
            "subject": f"person{self._number % people}",
            "wearing": "bench",
            "simulated": False,
            "run_id": f"{self._run_id:016x}",
        }


class _Watch:
    """Latency and age of all poses that are not repeated as stale."""

    def __init__(self) -> None:
        self.latency_ns, self.age_us = array("q"), array("L")

    def forget(self) -> None:
        del self.latency_ns[:], self.age_us[:]

    def hear(self, sample: zenoh.Sample) -> None:
        now, pose = time.monotonic_ns(), sample.payload.to_bytes()
        if not pose[_POSE_FLAGS_AT] & _STALE:
            self.latency_ns.append(now - _POSE_TIME.unpack_from(pose, _POSE_TIME_AT)[0])
            self.age_us.append(_POSE_AGE.unpack_from(pose, _POSE_AGE_AT)[0])


def _stream_until_calibrated(
    load: Load, session: zenoh.Session, hearing: zenoh.Session, gloves: list[GloveKeys],
    messages: list[_Messages],
) -> int:  # fmt: skip
    """A frame of each now and then, as a glove is there with its first frame; how many frames were sent."""
    deadline = time.monotonic() + 120
    for number in range(1200):
        for keys, of_glove in zip(gloves, messages, strict=True):
            session.put(keys.meta, json.dumps({**of_glove.meta(load.people), "glove": keys.glove}))
            session.put(keys.raw, of_glove.message(number))
        if all(_is_calibrated(hearing, keys) for keys in gloves):
            return (number + 1) * len(gloves)
        if time.monotonic() > deadline:
            break
        time.sleep(0.1)
    raise RuntimeError("the gloves were given no model in 120 s")


def _is_calibrated(session: zenoh.Session, keys: GloveKeys) -> bool:
    try:
        return ask_json(session, keys.pose_meta, timeout_s=1.0)["state"] == "calibrated"
    except NoAnswer:
        return False


class ProcessCost:
    """CPU time and resident memory of another process while it is entered, from /proc (Linux)."""

    def __init__(self, process: int) -> None:
        self._folder = Path(f"/proc/{process}")
        self.memory: list[tuple[float, float]] = []
        """(seconds since the start, MiB), once a second."""
        self.cpu_s: dict[str, float] = {}
        """By the names of its threads; zenoh's begin with ``rx``, ``tx``, ``net``, ``app`` or ``acc``."""

    def __enter__(self) -> ProcessCost:
        self._before, self._started = self._cpu_now(), time.monotonic()
        self._ended = Event()
        self._thread = Thread(target=self._follow_memory, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        after = self._cpu_now()
        for task, (name, seconds) in after.items():
            spent = seconds - self._before.get(task, (name, 0.0))[1]
            self.cpu_s[name] = self.cpu_s.get(name, 0.0) + spent

    def growth_mib(self, after_s: float) -> float:
        """Median memory of the last half minute less that of the half minute ``after_s`` after the start."""
        later = [mib for at, mib in self.memory if at >= after_s]
        return float(np.median(later[-30:]) - np.median(later[:30])) if later else float("nan")

    def _follow_memory(self) -> None:
        while not self._ended.wait(1.0):
            pages = int((self._folder / "statm").read_text().split()[1])
            self.memory.append((time.monotonic() - self._started, pages * os.sysconf("SC_PAGE_SIZE") / 2**20))

    def _cpu_now(self) -> dict[str, tuple[str, float]]:
        tasks = {}
        for task in (self._folder / "task").iterdir():
            name, _, rest = (task / "stat").read_text().partition("(")[2].rpartition(")")
            user, system = rest.split()[11:13]
            seconds = (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")
            tasks[task.name] = (name.rstrip("0123456789").rstrip("-"), seconds)
        return tasks
