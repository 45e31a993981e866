"""The capture daemon: device to log to wire, in that order, until it is told to stop.

A frame gets its sequence number, is appended to the local log, and only then published; whoever missed it
can ask the log. Each start is a new run with a random run id and sequence numbers from 0.
"""

from __future__ import annotations

import contextlib
import json
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from glovecal_client.capture.computer import computer_id
from glovecal_client.capture.device import Device, Reading, check_description
from glovecal_client.capture.glove_commands import GloveCommands
from glovecal_client.capture.link import CaptureLink, LinkSources
from glovecal_client.capture.log_folder import LogFolder
from glovecal_client.capture.log_queries import LogQueries
from glovecal_client.capture.reading_check import ReadingCheck
from glovecal_client.capture.reopening_device import ReopeningDevice
from glovecal_client.capture.status import CaptureState, CaptureStatus
from glovecal_client.clock import wall_ns
from glovecal_client.errors import DeviceError, DeviceFinished, DeviceLost
from glovecal_client.frame_log import BackgroundSync
from glovecal_client.keys import GloveKeys
from glovecal_client.session import DEFAULT_ENDPOINT
from glovecal_client.wire.frame import Frame, FrameFlag, encode_frame

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
        self._status = CaptureStatus(self._run_id, wall_ns())
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
            self._log = folder.create(self._run_id, self._meta())
            return self._run_with_log(folder, stop)
        finally:
            folder.close()

    def _run_with_log(self, folder: LogFolder, stop: threading.Event) -> CaptureSummary:
        queries = LogQueries(folder)
        self._index = queries.index(self._run_id)
        sources = LinkSources(self._status.text, self._meta_now, queries, self._commands.take)
        run = (self._status.started_wall_ns, self._run_id)
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
        return limit is not None and self._log.good_bytes >= limit // 2

    def _beat(self) -> None:
        """Once a second: the status, with the last refused reading if there was one since."""
        if self._refusal is not None:
            self._report(f"{self._refusal} ({self._status.bad_frames} refused so far)")
        self._status.refusal, self._refusal = self._refusal, None
        self._note_damaged()
        self._status.own_clock = getattr(self._device, "own_clock", None)
        self._link.publish_status()
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
