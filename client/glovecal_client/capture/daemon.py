"""The capture daemon: device to log to wire, in that order, until it is told to stop.

A reading that is fit to become a frame gets its sequence number, is appended to the local log, and only then
published; whoever missed it can ask the log. Each start is a new run with a random run id and sequence
numbers from 0.

A glove can be asked beside its stream, on ``glovecal/<site>/<glove>/control?do=NAME;with=ARGUMENT``, such as
"record on your card". That is carried out between two readings; the reply is the device's document.
"""

from __future__ import annotations

import contextlib
import json
import queue
import secrets
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import zenoh

from glovecal_client.capture.device import Device, Reading, ReopeningDevice, check_description
from glovecal_client.capture.link import CaptureLink, LinkSources
from glovecal_client.capture.log_folder import LogFolder, LogQueries
from glovecal_client.capture.status import CaptureState, CaptureStatus
from glovecal_client.clock import clock_ns, computer_id, wall_ns
from glovecal_client.errors import ClientError, DeviceError, DeviceFinished, DeviceLost, reason_of
from glovecal_client.frame_log import BackgroundSync
from glovecal_client.keys import JSON_ENCODING, GloveKeys, did_you_mean
from glovecal_client.session import DEFAULT_ENDPOINT, REFUSAL_ENCODING
from glovecal_client.wire.frame import Frame, FrameFlag, encode_frame

MOST_WAITING = 8


class GloveCommands:
    """Taken by zenoh's threads, carried out by the capture thread: one device, one thread."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._queue: queue.Queue[zenoh.Query] = queue.Queue(MOST_WAITING)

    @property
    def waiting(self) -> bool:
        """Whether ``carry_out`` has something to do."""
        return not self._queue.empty()

    def take(self, query: zenoh.Query) -> None:
        """Let a command wait; refused at once when too many do or the glove has none."""
        commands = getattr(self._device, "commands", {})
        name = str(query.parameters.get("do", ""))
        if not commands:
            _refuse(query, f"{self._device.name} is only listened to: it has no commands")
        elif name not in commands:
            meant = did_you_mean(name, commands)
            _refuse(query, f"{self._device.name} has no command {name!r}; {meant}")
        else:
            try:
                self._queue.put_nowait(query)
            except queue.Full:
                _refuse(query, f"{MOST_WAITING} commands wait already; ask again")

    def carry_out(self, *, is_open: bool) -> None:
        """The oldest one. Raises DeviceLost when the glove is lost meanwhile."""
        query = self._queue.get_nowait()
        if not is_open:
            _refuse(query, f"{self._device.name} is not open: plug it in")
            return
        do: Callable[[str, str], Mapping[str, Any]] = self._device.command  # type: ignore[attr-defined]
        try:
            answer = do(str(query.parameters.get("do", "")), str(query.parameters.get("with", "")))
        except Exception as error:  # a device is foreign code, perhaps a user's own
            is_ours = isinstance(error, ClientError)
            _refuse(query, reason_of(error) if is_ours else f"{self._device.name}: {reason_of(error)}")
            if isinstance(error, DeviceLost):
                raise
            return
        with query:
            query.reply(query.key_expr, json.dumps(dict(answer)), encoding=JSON_ENCODING)

    def close(self) -> None:
        """Answer what waits still."""
        while self.waiting:
            _refuse(self._queue.get_nowait(), "capture has stopped")


def _refuse(query: zenoh.Query, sentence: str) -> None:
    with query:
        query.reply_err(sentence, encoding=REFUSAL_ENCODING)


_MAX_AHEAD_NS = 1_000_000_000


class ReadingCheck:
    """Refuses readings that are not what the device said it produces, and tells why."""

    def __init__(self, device: Device) -> None:
        self._sensors = tuple(device.sensors)
        self._context = tuple(device.context)
        self._counts: tuple[float, float] | None = getattr(device, "counts", None)
        self._last_ns: int | None = None

    def is_duplicate(self, reading: Reading) -> bool:
        """Whether it was taken at the same nanosecond as the one before: the same reading given twice."""
        return self._last_ns is not None and reading.monotonic_ns == self._last_ns

    def fault(self, reading: Reading) -> str | None:
        """A sentence saying what is wrong, None if nothing is; the next must then be later than this."""
        fault = self._values_fault(reading) or self._time_fault(reading)
        if fault is None:
            self._last_ns = reading.monotonic_ns
        return fault

    def _values_fault(self, reading: Reading) -> str | None:
        try:
            readings, context = _as_sent(reading.readings), _as_sent(reading.context)
        except (TypeError, ValueError):
            return "its values are no numbers"
        if readings.shape != (len(self._sensors),):
            return f"{_size(readings)} sensor values instead of {len(self._sensors)}"
        if context.shape != (len(self._context),):
            return f"{_size(context)} context values instead of {len(self._context)}"
        if len(context) and np.isinf(context).any():
            return f"context {self._context[int(np.argmax(np.isinf(context)))]} is infinite"
        if self._is_within_counts(readings):
            return None
        bad = ~np.isfinite(readings)
        if bad.any():
            column = int(np.argmax(bad))
            return f"sensor {self._sensors[column]} reads {readings[column]}"
        return self._counts_fault(readings)

    def _is_within_counts(self, readings: np.ndarray) -> bool:
        """The usual case, told by two numbers: NaN and infinity are in no range."""
        if self._counts is None or not len(readings):
            return False
        return bool(self._counts[0] <= np.minimum.reduce(readings)) and bool(
            np.maximum.reduce(readings) <= self._counts[1]
        )

    def _counts_fault(self, readings: np.ndarray) -> str | None:
        if self._counts is None:
            return None
        low, high = self._counts
        outside = (readings < low) | (readings > high)
        if not outside.any():
            return None
        column = int(np.argmax(outside))
        return f"sensor {self._sensors[column]} reads {readings[column]:g}, outside {low:g} to {high:g}"

    def _time_fault(self, reading: Reading) -> str | None:
        for stamp in (reading.monotonic_ns, reading.wall_ns):
            if not isinstance(stamp, int) or not -(1 << 63) <= stamp < 1 << 63:
                return f"its time {stamp!r} is not a whole number of nanoseconds"
        if self._last_ns is not None and reading.monotonic_ns < self._last_ns:
            return f"its time is {(self._last_ns - reading.monotonic_ns) / 1e6:g} ms before the one before it"
        ahead_ns = reading.monotonic_ns - clock_ns()
        if ahead_ns > _MAX_AHEAD_NS:
            return f"its time is {ahead_ns / 1e9:g} s in the future"
        return None


def _as_sent(values: np.ndarray) -> np.ndarray:
    """As float32, which is what a frame holds; what is too large for it becomes infinite."""
    if isinstance(values, np.ndarray) and values.dtype == np.float32:
        return values
    with np.errstate(over="ignore"):
        return np.asarray(values, dtype=np.float32)


def _size(values: np.ndarray) -> str:
    return str(len(values)) if values.ndim == 1 else f"an array of shape {values.shape} with"


_READ_TIMEOUT_S = 0.1
_STATUS_PERIOD_S = 1.0


@dataclass(frozen=True)
class CaptureSettings:
    """Which glove is captured, for whom, and where to."""

    keys: GloveKeys
    subject: str | None = None
    wearing: str | None = None
    endpoints: tuple[str, ...] = (DEFAULT_ENDPOINT,)
    data: Path = Path("glovecal-data")
    log_limit: int | None = None
    """Bytes that all logs of the glove may have: half for earlier runs, half for this one. None: no limit."""


@dataclass(frozen=True)
class CaptureSummary:
    """What a run came to."""

    run_id: int
    frames: int
    bad_frames: int
    duplicates: int
    reconnects: int
    frames_not_logged: int
    log: Path
    log_is_full: bool = False
    """The run ended because its log has reached its share of the limit."""

    def __str__(self) -> str:
        return (
            f"run {self.run_id:016x}: {self.frames} frames, {self.bad_frames} readings refused, "
            f"{self.duplicates} duplicates, {self.reconnects} reconnects, "
            f"{self.frames_not_logged} frames not in the log; log {self.log}"
        )


class CaptureDaemon:
    """One run. ``run`` returns when ``stop`` is set or the device has no more to give."""

    def __init__(self, device: Device, settings: CaptureSettings, report: Callable[[str], None]) -> None:
        """Raises DeviceError for a device whose description cannot be."""
        check_description(device)
        self._device = device
        self._settings = settings
        self._report = report
        self._run_id = secrets.randbits(64)
        self._status = CaptureStatus(self._run_id, wall_ns(), clock_ns())
        self._check = ReadingCheck(device)
        self._refusal: str | None = None
        self._tell_damaged_at = 1
        self._commands = GloveCommands(device)
        self._earlier_runs: list[dict[str, Any]] = []
        self._flags = int(FrameFlag.SIMULATED) if device.simulated else 0

    def run(self, stop: threading.Event) -> CaptureSummary:
        """Capture until told to stop. Raises CaptureRefused, DeviceError (it cannot work at all)."""
        folder = LogFolder(self._settings.data, self._settings.keys)
        limit = self._settings.log_limit
        try:
            folder.repair(self._report)
            if limit is not None:
                folder.forget(limit // 2, self._report)
            self._earlier_runs = folder.runs()
            folder.encrypt_earlier(self._report)
            self._log = folder.create(self._run_id, self._meta())
            return self._run_with_log(folder, stop)
        finally:
            folder.close()

    def _run_with_log(self, folder: LogFolder, stop: threading.Event) -> CaptureSummary:
        queries = LogQueries(folder)
        self._index = queries.index(self._run_id)
        sources = LinkSources(self._status.text, self._meta_now, queries, self._commands.take)
        run = (self._status.started_wall_ns, self._run_id)
        self._folder = folder
        self._link = CaptureLink(self._settings.keys, self._settings.endpoints, run, sources, self._report)
        reopening = ReopeningDevice(self._device)
        syncing = BackgroundSync(self._log)
        try:
            self._link.start(stop.is_set)
            self._capture(reopening, stop)
        finally:
            self._commands.close()
            reopening.close()
            syncing.close()
            self._log.close()
            self._watch_disk()
            self._change("stopped", "stopped")
            self._link.close()
        return self._summary()

    def _capture(self, device: ReopeningDevice, stop: threading.Event) -> None:
        next_status = 0.0
        while not stop.is_set() and not self._log_is_full:
            if time.monotonic() >= next_status:
                self._beat()
                next_status = time.monotonic() + _STATUS_PERIOD_S
            try:
                if self._commands.waiting:
                    self._commands.carry_out(is_open=device.is_open)
                reading = device.read(_READ_TIMEOUT_S)
            except DeviceFinished as error:
                self._report(str(error))
                return
            except DeviceError as error:
                if self._status.state == "opening" and not isinstance(error, DeviceLost):
                    raise
                self._change("lost", f"{error}; trying to open it again")
                continue
            self._note_opening(device)
            if reading is not None:
                self._take(reading)

    @property
    def _log_is_full(self) -> bool:
        limit = self._settings.log_limit
        return limit is not None and self._log.file_bytes >= limit // 2

    def _beat(self) -> None:
        """Once a second: the status, with the last refused reading if there was one since."""
        if self._refusal is not None:
            self._report(f"{self._refusal} ({self._status.bad_frames} refused so far)")
        self._status.refusal, self._refusal = self._refusal, None
        self._note_damaged()
        self._status.own_clock = getattr(self._device, "own_clock", None)
        self._link.publish_status()
        self._folder.beat()
        with contextlib.suppress(OSError):  # a disk that fails shows in the log's own problem
            self._index.extend()

    def _note_damaged(self) -> None:
        """Records the driver threw away; told when their number has doubled, so that a log stays short."""
        if (counters := getattr(self._device, "counters", None)) is None:
            return
        self._status.damaged_frames = counters.bad_frames
        self._status.last_damaged = getattr(counters, "last_refused", "") or None
        if counters.bad_frames >= self._tell_damaged_at and self._status.last_damaged:
            self._report(f"line refused: {self._status.last_damaged} ({counters.bad_frames} refused so far)")
            self._tell_damaged_at = 2 * counters.bad_frames

    def _note_opening(self, device: ReopeningDevice) -> None:
        if device.is_open and self._status.state != "streaming":
            self._status.reconnects = device.openings - 1
            notice = getattr(self._device, "notice", None)
            self._change("streaming", f"{self._device.name} is open" + (f"; {notice}" if notice else ""))

    def _take(self, reading: Reading) -> None:
        """Refuse the reading, or number, log and publish it."""
        if self._check.is_duplicate(reading):
            self._status.duplicates += 1
            return
        fault = self._check.fault(reading)
        if fault is not None:
            self._status.bad_frames += 1
            self._refusal = f"reading refused: {fault}"
            return
        message = encode_frame(self._frame(reading))
        self._log.append(message)
        self._link.publish(message)
        self._status.frame_sent(reading.monotonic_ns)
        self._watch_disk()

    def _frame(self, reading: Reading) -> Frame:
        return Frame(
            sequence=self._status.frames,
            run_id=self._run_id,
            monotonic_ns=reading.monotonic_ns,
            wall_ns=reading.wall_ns,
            readings=reading.readings,
            context=reading.context,
            flags=self._flags | (int(FrameFlag.BUTTON) if reading.button else 0),
        )

    def _watch_disk(self) -> None:
        self._status.frames_not_logged = self._log.lost_records + self._log.waiting
        problem = self._log.problem
        sentence = None if problem is None else f"the recording does not reach the disk: {problem}"
        if sentence != self._status.disk_problem:
            self._status.disk_problem = sentence
            self._report(sentence or "the recording reaches the disk again")
            self._link.publish_status()

    def _change(self, state: CaptureState, sentence: str) -> None:
        if self._status.change(state, sentence):
            self._report(sentence)
            self._link.publish_status()

    def _meta(self) -> dict[str, Any]:
        device, keys = self._device, self._settings.keys
        return {
            "site": keys.site,
            "glove": keys.glove,
            "layout": device.layout,
            "sensors": list(device.sensors),
            "context": list(device.context),
            "subject": self._settings.subject,
            "wearing": self._settings.wearing,
            "hand": getattr(device, "hand", "unknown"),
            "simulated": device.simulated,
            "rate_hz": device.rate_hz,
            "computer": computer_id(),
            "commands": dict(getattr(device, "commands", {})),
            "run_id": f"{self._run_id:016x}",
            "device": device.name,
            "started_wall_ns": self._status.started_wall_ns,
            "started_ns": self._status.started_ns,
            "software": f"glovecal-client {metadata.version('glovecal-client')}",
        }

    def _meta_now(self) -> str:
        self._index.extend()
        in_log = {"log_from": self._index.first, "log_to": self._index.last}
        return json.dumps(self._meta() | in_log | {"earlier_runs": self._earlier_runs}, allow_nan=False)

    def _summary(self) -> CaptureSummary:
        status = self._status
        return CaptureSummary(
            run_id=self._run_id,
            frames=status.frames,
            bad_frames=status.bad_frames,
            duplicates=status.duplicates,
            reconnects=status.reconnects,
            frames_not_logged=status.frames_not_logged,
            log=self._log.path,
            log_is_full=self._log_is_full,
        )
