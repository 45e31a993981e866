"""Device ``replay:FILE``: plays a recording back at its own pace, with the times of now."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import ClassVar

from glovecal_client.capture.device import Reading, check_options
from glovecal_client.capture.replayed_frames import ReplayedFrame, nominal_rate_hz, open_recording
from glovecal_client.clock import clock_ns, clock_s, wall_ns
from glovecal_client.errors import BadOption, DeviceFinished
from glovecal_client.names import check_identifier


class ReplayDevice:
    """Gives the frames of a recording ``speed`` times as fast as they were taken, once or for ever.

    A reading that is missing in the recording comes as NaN, for the daemon to refuse and count.
    """

    option_help: ClassVar[dict[str, str]] = {
        "speed": "TIMES (1 is as recorded)",
        "loop": "yes|no (no)",
        "layout": "NAME (as in the recording)",
    }

    def __init__(
        self, path: Path | str, *, speed: float = 1.0, loop: bool = False, layout: str | None = None
    ) -> None:
        """Raises BadOption if the file cannot be replayed; all of it is read once for that."""
        if not 0 < speed < float("inf"):
            raise BadOption(f"replay: speed {speed:g} must be a positive number")
        path = Path(path)
        self._recording = open_recording(path)
        self._speed = speed
        self._loop = loop
        self._frames: Iterator[ReplayedFrame] | None = None
        self.name: str = f"replay:{path.name}"
        self.layout: str = layout or self._recording.layout
        self.sensors: tuple[str, ...] = self._recording.sensors
        self.context: tuple[str, ...] = self._recording.context
        self.hand: str = self._recording.hand
        self.simulated: bool = self._recording.simulated
        self.rate_hz: float = nominal_rate_hz(self._recording) * speed
        self._count = sum(1 for _ in self._recording.frames())

    @classmethod
    def from_options(cls, argument: str | None, options: Mapping[str, str]) -> ReplayDevice:
        """``replay:FILE`` with options ``speed=2``, ``loop=yes``, ``layout=NAME``. Raises BadOption."""
        if not argument:
            raise BadOption("device replay needs a file: replay:FILE")
        check_options("replay", options, cls.option_help)
        loop = options.get("loop", "no")
        if loop not in ("yes", "no"):
            raise BadOption(f"replay: loop={loop!r} must be yes or no")
        try:
            speed = float(options.get("speed", "1"))
        except ValueError:
            raise BadOption(f"replay: speed={options['speed']!r} is not a number") from None
        layout = options.get("layout")
        if layout is not None:
            check_identifier(layout, "layout")
        return cls(Path(argument), speed=speed, loop=loop == "yes", layout=layout)

    def open(self) -> None:
        """Start from the beginning."""
        self._frames = self._recording.frames()
        self._due_s = clock_s()
        self._before: ReplayedFrame | None = None
        self._next: ReplayedFrame | None = None
        self._given = 0

    def close(self) -> None:
        """Stop; ``open`` starts from the beginning again."""
        self._frames = None

    def read(self, timeout_s: float) -> Reading | None:
        """The next recorded frame when its time has come. Raises DeviceFinished at the end."""
        if self._next is None:
            self._next = self._advance()
            self._due_s += self._step_s(self._before, self._next)
        waiting = self._due_s - clock_s()
        if waiting > timeout_s:
            time.sleep(timeout_s)
            return None
        if waiting > 0:
            time.sleep(waiting)
        frame, self._next = self._next, None
        self._before = frame
        self._given += 1
        return Reading(frame.readings, clock_ns(), wall_ns(), context=frame.context, button=frame.button)

    def _advance(self) -> ReplayedFrame:
        if self._frames is None:
            raise DeviceFinished(f"{self.name}: not open")
        frame = next(self._frames, None)
        if frame is None and self._loop:
            self._frames = self._recording.frames()
            frame = next(self._frames, None)
        if frame is None:
            raise DeviceFinished(f"{self.name}: all {self._given} frames were replayed")
        return frame

    def _step_s(self, before: ReplayedFrame | None, after: ReplayedFrame) -> float:
        """Seconds from one frame to the next; one nominal period where the recording starts anew."""
        if before is None:
            return 0.0
        step = after.time_s - before.time_s
        if after.stretch != before.stretch or step < 0:
            return 1.0 / self.rate_hz
        return step / self._speed
