"""The capture logs of one glove: ``DATA/capture/<site>/<glove>/<start>-<run>.glvlog``, one file a run."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from glovecal_client.errors import CaptureRefused, DamagedLog, reason_of
from glovecal_client.frame_log import FrameLog
from glovecal_client.keys import GloveKeys
from glovecal_client.log_records import Recording, cut_damaged_tail
from glovecal_client.operating_system import lock_file
from glovecal_client.private_files import make_private

SUFFIX = ".glvlog"
EARLIER_RUNS = 16


class LogFolder:
    """The folder, held by one daemon at a time (the lock goes with the process, also on kill -9)."""

    def __init__(self, data: Path, keys: GloveKeys) -> None:
        """Create the folder if needed and lock it. Raises CaptureRefused."""
        self.path: Path = data / "capture" / keys.site / keys.glove
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            with suppress(PermissionError):  # a file system without permissions takes recordings all the same
                make_private(data / "capture")
            self._lock = (self.path / "lock").open("ab")
        except OSError as error:
            raise CaptureRefused(
                f"capture of glove {keys.glove!r}: cannot write in {self.path}: {reason_of(error)}"
            ) from error
        try:
            lock_file(self._lock)
        except OSError as error:
            self._lock.close()
            raise CaptureRefused(
                f"capture of glove {keys.glove!r}: another capture on this computer is writing to {self.path}"
            ) from error

    def close(self) -> None:
        """Let go of the folder."""
        self._lock.close()

    def repair(self, report: Callable[[str], None]) -> None:
        """Cut a damaged tail off the log of the last run and tell it to ``report``.

        Earlier logs were looked at when the run after them started, and are not touched again.
        """
        logs = list(self.path.glob(f"*{SUFFIX}"))
        if not logs:
            return
        path = max(logs, key=lambda log: log.stat().st_mtime_ns)
        try:
            cut = cut_damaged_tail(path)
        except (DamagedLog, OSError) as error:
            report(f"earlier recording left as it is: {reason_of(error)}")
        else:
            if cut:
                report(f"earlier recording {path.name}: {cut} damaged bytes moved to {path.name}.cut")

    def forget(self, at_most: int, report: Callable[[str], None]) -> None:
        """Delete logs of earlier runs, oldest first, until those left have ``at_most`` bytes together."""
        kept = 0
        logs = [(log.stat(), log) for log in self.path.glob(f"*{SUFFIX}*")]
        for about, log in sorted(logs, key=lambda log: log[0].st_mtime_ns, reverse=True):
            kept += about.st_size
            if kept <= at_most:
                continue
            try:
                log.unlink()
            except OSError as error:
                report(
                    f"earlier recording {log.name} cannot be deleted, which the limit asks: {error.strerror}"
                )
            else:
                report(f"earlier recording {log.name} deleted: the limit is reached")

    def create(self, run_id: int, meta: Mapping[str, Any]) -> FrameLog:
        """The log of a new run. Raises CaptureRefused if it cannot be written."""
        start = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
        path = self.path / f"{start}-{run_id:016x}{SUFFIX}"
        try:
            return FrameLog.create(path, meta)
        except OSError as error:
            raise CaptureRefused(
                f"capture does not start without its recording: {path}: {reason_of(error)}"
            ) from error

    def runs(self) -> list[dict[str, Any]]:
        """``run_id`` and ``started_wall_ns`` of the newest logs, oldest first; damaged ones are left out."""
        found = []
        for path in sorted(self.path.glob(f"*{SUFFIX}"), key=lambda log: log.name)[-EARLIER_RUNS:]:
            with suppress(DamagedLog, OSError, KeyError):
                meta = Recording.open(path).meta
                found.append({name: meta[name] for name in ("run_id", "started_wall_ns")})
        return sorted(found, key=lambda run: run["started_wall_ns"])

    def find(self, run_id: int) -> Path | None:
        """The log of a run, None if there is none."""
        return next(iter(self.path.glob(f"*-{run_id:016x}{SUFFIX}")), None)
