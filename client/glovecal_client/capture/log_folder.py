"""The capture logs of one glove: ``DATA/capture/<site>/<glove>/<start>-<run>.glvlog``, one file a run.

Frames of a run are found by sequence number while its log is still growing, and sent to whoever asks for them
(``?run=HEX16;from=A;to=B``), or a digest of them to whoever has them already (``;digest=sha256``).
"""

from __future__ import annotations

import bisect
import hashlib
import json
import os
import re
import struct
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from glovecal_client.encryption.kept_file import UNFINISHED, encrypt_file, is_encrypting, open_kept
from glovecal_client.encryption.key_file import settle_encryption
from glovecal_client.errors import BadEncryptionKey, BadName, CaptureRefused, DamagedLog, reason_of
from glovecal_client.frame_log import FrameLog, Recording, cut_damaged_tail, scan_records
from glovecal_client.keys import GloveKeys
from glovecal_client.operating_system import lock_file, remove
from glovecal_client.private_files import make_private
from glovecal_client.wire.frame import frame_sequence

SUFFIX = ".glvlog"
LOCK = "lock"
EARLIER_RUNS = 16


class LogFolder:
    """The folder, held by one daemon at a time (the lock goes with the process, also on kill -9)."""

    def __init__(self, data: Path, keys: GloveKeys) -> None:
        """Create the folder if needed and lock it. Raises CaptureRefused, BadEncryptionKey."""
        self.path: Path = data / "capture" / keys.site / keys.glove
        try:
            settle_encryption(data)
            self.path.mkdir(parents=True, exist_ok=True)
            with suppress(PermissionError):  # a file system without permissions takes recordings all the same
                make_private(data / "capture")
            self._lock = (self.path / LOCK).open("ab")
        except BadEncryptionKey:
            raise
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

    def beat(self) -> None:
        """A sign of life of the daemon, which ``seen_s_ago`` sees: the lock's own time."""
        with suppress(OSError):
            os.utime(self.path / LOCK)

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

    def encrypt_earlier(self, report: Callable[[str], None]) -> None:
        """Beside the capture encrypt logs of earlier runs that were written before a key was named.

        Whoever looks frames up finds the one file or the other, with the same content.
        """
        for unfinished in self.path.glob(f"*{UNFINISHED}"):
            remove(unfinished)
        if is_encrypting():
            logs = sorted(self.path.glob(f"*{SUFFIX}*"))
            threading.Thread(target=_encrypt, args=(logs, report), name="encryption", daemon=True).start()

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
        """``run_id`` and ``started_wall_ns`` of the newest logs, oldest first; damaged ones are left out.

        And ``started_ns`` and ``computer``, whose monotonic clock that is by, where a log says so.
        """
        found = []
        for path in sorted(self.path.glob(f"*{SUFFIX}"), key=lambda log: log.name)[-EARLIER_RUNS:]:
            with suppress(DamagedLog, OSError, KeyError):
                meta = Recording.open(path).meta
                run = {name: meta[name] for name in ("run_id", "started_wall_ns")}
                found.append(run | {name: meta[name] for name in ("started_ns", "computer") if name in meta})
        return sorted(found, key=lambda run: run["started_wall_ns"])

    def find(self, run_id: int) -> Path | None:
        """The log of a run, None if there is none."""
        return next(iter(self.path.glob(f"*-{run_id:016x}{SUFFIX}")), None)


def seen_s_ago(data: Path) -> tuple[str, float] | None:
    """Of the daemon below ``data`` that was seen last: its glove, and seconds since then; None: none was."""
    locks = list((data / "capture").glob(f"*/*/{LOCK}"))
    if not locks:
        return None
    last = max(locks, key=lambda lock: lock.stat().st_mtime)
    return last.parent.name, max(0.0, time.time() - last.stat().st_mtime)


def _encrypt(logs: list[Path], report: Callable[[str], None]) -> None:
    for log in logs:
        try:
            if encrypt_file(log, grows=True):
                report(f"earlier recording {log.name} is encrypted now")
        except FileNotFoundError:  # over its limit meanwhile
            continue
        except OSError as error:
            report(f"earlier recording {log.name} is not encrypted: {reason_of(error)}")


_EVERY = 64
"""One entry for so many records: 8 hours at 120 Hz need less than 1 MB."""


class LogIndex:
    """A sparse index of a log whose frames have increasing sequence numbers. Safe for several threads."""

    def __init__(self, path: Path) -> None:
        self._recording = Recording.open(path)
        self._lock = threading.Lock()
        self._sequences: list[int] = []
        self._offsets: list[int] = []
        self._records = 0
        self._end = self._recording.first_record
        self.first: int | None = None
        """Lowest sequence number in the log, None while it is empty."""
        self.last: int | None = None
        """Highest sequence number in the log as of the last ``extend``."""

    def extend(self) -> None:
        """Take in the records written since the last call. Raises OSError."""
        with self._lock, open_kept(self._recording.path) as file:
            start = self._end
            for end, payload in scan_records(file, self._end):
                self._add(frame_sequence(payload), start)
                start = self._end = end

    def _add(self, sequence: int, offset: int) -> None:
        if self._records % _EVERY == 0:
            self._sequences.append(sequence)
            self._offsets.append(offset)
        self._records += 1
        self.last = sequence
        if self.first is None:
            self.first = sequence

    def payloads(self, first: int, last: int, *, max_count: int, max_bytes: int) -> list[bytes]:
        """Frames with sequence ``first`` to ``last``, both included, up to the bounds, in order."""
        self.extend()
        with self._lock:
            entry = bisect.bisect_right(self._sequences, first) - 1
            offset = self._offsets[entry] if entry >= 0 else self._recording.first_record
        found: list[bytes] = []
        total = 0
        with open_kept(self._recording.path) as file:
            for _, payload in scan_records(file, offset):
                sequence = frame_sequence(payload)
                total += len(payload) if sequence >= first else 0
                if sequence > last or len(found) >= max_count or total > max_bytes:
                    break
                if sequence >= first:
                    found.append(payload)
        return found


MAX_REPLY_FRAMES = 4096
MAX_REPLY_BYTES = 4 << 20
_QUESTION = re.compile(r"run=([0-9a-f]{16});from=([0-9]{1,20});to=([0-9]{1,20})(;digest=sha256)?\Z")
_LENGTH = struct.Struct("<I")


class LogQueries:
    """Looks frames up in the logs of one glove, those of the running and of earlier runs."""

    def __init__(self, folder: LogFolder) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        self._indexes: dict[int, LogIndex] = {}

    def index(self, run_id: int) -> LogIndex:
        """The index of a run's log. Raises BadName for a run that was not recorded here."""
        with self._lock:
            if run_id not in self._indexes:
                path = self._folder.find(run_id)
                if path is None:
                    raise BadName(f"run {run_id:016x} was not recorded here")
                self._indexes[run_id] = LogIndex(path)
            return self._indexes[run_id]

    def answer(self, parameters: str) -> bytes:
        """The reply's payload: each frame as u32 length and bytes, or JSON on what those bytes would be.

        Raises BadName, WireError, DamagedLog.
        """
        asked = _QUESTION.match(parameters)
        if not asked:
            raise BadName(
                f"log query {parameters[:80]!r} is not run=HEX16;from=A;to=B, and ;digest=sha256 for a digest"
            )
        first, last = int(asked[2]), int(asked[3])
        if first > last:
            raise BadName(f"log query: from={first} is after to={last}")
        found = self.index(int(asked[1], 16)).payloads(
            first, last, max_count=MAX_REPLY_FRAMES, max_bytes=MAX_REPLY_BYTES
        )
        reply = b"".join(_LENGTH.pack(len(payload)) + payload for payload in found)
        return _digest(found, reply) if asked[4] else reply


def _digest(frames: list[bytes], reply: bytes) -> bytes:
    ends = {"first": frame_sequence(frames[0]), "last": frame_sequence(frames[-1])} if frames else {}
    return json.dumps({"frames": len(frames), **ends, "sha256": hashlib.sha256(reply).hexdigest()}).encode()
