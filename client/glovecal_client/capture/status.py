"""What the capture daemon says about itself, on change and once a second."""

from __future__ import annotations

import json
import threading
from collections import deque
from dataclasses import dataclass, field
from typing import Any, Literal

from glovecal_client.clock import clock_ns, wall_ns

CaptureState = Literal["opening", "streaming", "lost", "stopped"]
_SILENT_NS = 2_000_000_000


@dataclass
class CaptureStatus:
    """Counters of one run. Written by the capture thread, read by zenoh's threads through ``document``."""

    run_id: int
    started_wall_ns: int
    started_ns: int
    """By the monotonic clock."""
    state: CaptureState = "opening"
    sentence: str = "opening the device"
    frames: int = 0
    bad_frames: int = 0
    """Readings the daemon refused."""
    damaged_frames: int = 0
    """Records that the driver threw away because they came damaged from the glove."""
    last_damaged: str | None = None
    """The last of them and why it was thrown away; None before the first, or where the driver cannot tell."""
    duplicates: int = 0
    reconnects: int = 0
    refusal: str | None = None
    """Why readings were refused in the last second, None if none were."""
    disk_problem: str | None = None
    frames_not_logged: int = 0
    own_clock: dict[str, Any] | None = None
    """How the glove's own clock stands against the computer's, None for a glove without one."""
    _times: deque[int] = field(default_factory=lambda: deque(maxlen=241))
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def change(self, state: CaptureState, sentence: str) -> bool:
        """Take on a new state; True if it is one."""
        changed = (state, sentence) != (self.state, self.sentence)
        self.state, self.sentence = state, sentence
        return changed

    def frame_sent(self, now_ns: int) -> None:
        """Count one frame that was given a sequence number."""
        with self._lock:
            self.frames += 1
            self._times.append(now_ns)

    def document(self) -> dict[str, Any]:
        """The status as JSON-able data; ``sequence`` is the last one given, null before the first."""
        now_ns = clock_ns()
        with self._lock:
            age = round((now_ns - self._times[-1]) / 1e9, 3) if self._times else None
            return {
                "state": self.state,
                "sequence": self.frames - 1 if self.frames else None,
                "frames": self.frames,
                "rate_hz": self._measured_rate(now_ns),
                "bad_frames": self.bad_frames,
                "damaged_frames": self.damaged_frames,
                "last_damaged": self.last_damaged,
                "duplicates": self.duplicates,
                "last_frame_age_s": age,
                "reconnects": self.reconnects,
                "disk": "full" if self.disk_problem else "ok",
                "frames_not_logged": self.frames_not_logged,
                "sentence": self.disk_problem or self.refusal or self._silence(age) or self.sentence,
                "run_id": f"{self.run_id:016x}",
                "own_clock": self.own_clock,
                "started_wall_ns": self.started_wall_ns,
                "started_ns": self.started_ns,
                "wall_ns": wall_ns(),
                "monotonic_ns": now_ns,
            }

    def _silence(self, age_s: float | None) -> str | None:
        if self.state != "streaming" or (age_s is not None and age_s * 1e9 < _SILENT_NS):
            return None
        return "the device is open, but gave no reading " + ("yet" if age_s is None else f"for {age_s:.0f} s")

    def _measured_rate(self, now_ns: int) -> float:
        times = self._times
        if len(times) < 2 or now_ns - times[-1] > _SILENT_NS or times[-1] == times[0]:
            return 0.0
        return round((len(times) - 1) * 1e9 / (times[-1] - times[0]), 2)

    def text(self) -> str:
        """The document as JSON."""
        return json.dumps(self.document(), allow_nan=False)
