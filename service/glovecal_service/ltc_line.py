"""Linear time code from a line, as it sounds: which label this computer's monotonic clock has now.

Sound comes as a WAV stream, from a pipe or a FIFO, as ``arecord`` and ``ffmpeg`` write it. A sample is never
read before it was heard, and the block that travelled fastest tells best how the sound card's clock stands.
Only the newest seconds of labels and the newest tenths of sound are kept.
"""

from __future__ import annotations

import math
import stat
import struct
import sys
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event, Thread
from typing import BinaryIO

import numpy as np

from glovecal_client.capture.device_clock import DeviceClock
from glovecal_client.clock import clock_ns, clock_s
from glovecal_models.errors import BadInput
from glovecal_models.takes.time_code import TimeCode
from glovecal_service.ltc import LEAST_SAMPLES_PER_S, LtcFrames, decode_ltc, pcm_samples, reading_of

STANDARD_INPUT = "-"
SOURCE = "LTC of a line"
DECODE_EVERY_S = 0.1
OVERLAP_S = 0.15
"""More than the longest frame, and what the decoder's filters reach."""
WINDOW_S = 2.0
"""Of frames that a time code is read from."""
LEAST_FRAMES = 10
LOST_AFTER_S = 1.0
SAMPLES_LOST_S = 0.03
"""Sound that comes so much later than it should, and goes on so, was lost on its way."""
_BLOCKS_JUDGED = 40
_READ_BYTES = 65_536
_MOST_CHANNELS = 8
_PCM, _EXTENSIBLE = 1, 0xFFFE


@dataclass(frozen=True)
class SoundForm:
    """Of PCM samples."""

    samples_per_s: int
    channels: int = 1
    width: int = 2
    """Bytes."""


class LtcLine:
    """``take`` on one thread; ``time_code`` and ``look`` on any other."""

    def __init__(
        self,
        form: SoundForm,
        rate: str | None,
        *,
        tell: Callable[[str], None],
        now_s: Callable[[], float] = clock_s,
    ) -> None:
        """``rate``: a name in ``RATES``, None to measure it; ``now_s``: this computer's monotonic clock."""
        self._form, self._rate, self._tell, self._now_s = form, rate, tell, now_s
        self._rest = b""
        self._sound = np.zeros((0, form.channels), np.int16)
        self._clock = DeviceClock(form.samples_per_s, wrap=math.inf)
        self._samples = self._decoded = 0
        self._offset_s = 0.0
        self._late_s: deque[float] = deque(maxlen=_BLOCKS_JUDGED)
        self._frames = _no_frames()
        self._known: tuple[TimeCode, float] | None = None
        self._was_there: bool | None = None

    @property
    def time_code(self) -> TimeCode | None:
        """By this computer's monotonic clock; None while none is on the line."""
        known = self._known
        return None if known is None or self._now_s() - known[1] > LOST_AFTER_S else known[0]

    def look(self) -> None:
        """Tell once that the time code is there, or no longer."""
        known, code = self._known, self.time_code
        if (code is not None) == self._was_there:
            return
        if code is not None:
            self._tell(
                f"Time code on the line: {code.at(self._now_s())}, {code.counting.named} frames a second."
            )
        elif known is None:
            if self._was_there is None:
                return
        else:
            last = known[0].at(known[1])
            self._tell(f"No time code on the line since {last}: takes that begin now have none.")
        self._was_there = code is not None

    def take(self, content: bytes, arrived_ns: int) -> None:
        """The next bytes of the sound, and when the last of them came, ``clock_ns``."""
        content = self._rest + content
        size = self._form.width * self._form.channels
        whole = len(content) // size * size
        self._rest = content[whole:]
        if not whole:
            return
        new = pcm_samples(content[:whole], self._form.width, self._form.channels)
        self._samples += len(new)
        self._note_arrival(arrived_ns)
        self._sound = np.concatenate([self._sound, new])
        if self._samples - self._decoded >= DECODE_EVERY_S * self._form.samples_per_s:
            self._decode()

    def _note_arrival(self, arrived_ns: int) -> None:
        sound_s = self._samples / self._form.samples_per_s
        given_ns = self._clock.monotonic_ns(self._samples, arrived_ns)
        self._offset_s = given_ns / 1e9 - sound_s
        self._late_s.append((arrived_ns - given_ns) / 1e9)
        if len(self._late_s) == _BLOCKS_JUDGED and min(self._late_s) > SAMPLES_LOST_S:
            self._tell(f"{min(self._late_s):.2f} s of the line's sound were lost; its times are found anew.")
            self._clock = DeviceClock(self._form.samples_per_s, wrap=math.inf)
            self._late_s.clear()
            self._forget()

    def _forget(self) -> None:
        self._frames, self._known = _no_frames(), None

    def _decode(self) -> None:
        self._decoded = self._samples
        per_s = self._form.samples_per_s
        begin_s = (self._samples - len(self._sound)) / per_s
        channels = [decode_ltc(self._sound[:, each], per_s) for each in range(self._form.channels)]
        channel = max(range(len(channels)), key=lambda each: len(channels[each]))
        frames = replace(channels[channel], start_s=channels[channel].start_s + begin_s)
        self._sound = self._sound[-round(OVERLAP_S * per_s) :]
        if len(self._frames):
            frames = _some(frames, frames.start_s > self._frames.start_s[-1] + DECODE_EVERY_S / 10)
        if len(frames):
            self._add(frames, channel)

    def _add(self, frames: LtcFrames, channel: int) -> None:
        """Frames that have come; where labels jump, what was before is forgotten."""
        code = None if self._known is None else self._known[0]
        if code is not None:
            for place, (label, start_s) in enumerate(zip(frames.labels, frames.start_s, strict=True)):
                expected = code.at(start_s + self._offset_s + 0.25 / float(code.counting.frames_per_s))
                if expected != (written := _label(label, expected)):
                    self._tell(f"The time code on the line jumped from {expected} to {written}.")
                    self._forget()
                    frames = _some(frames, np.arange(len(frames)) >= place)
                    break
        both = LtcFrames(
            *(np.concatenate([getattr(part, name) for part in (self._frames, frames)]) for name in _FIELDS)
        )
        self._frames = _some(both, both.start_s > both.start_s[-1] - WINDOW_S)
        if len(self._frames) < LEAST_FRAMES:
            return
        try:
            reading = reading_of(self._frames, self._rate, SOURCE, channel + 1)
        except BadInput as error:
            self._tell(f"The time code on the line cannot be used: {error}.")
            self._forget()
            return
        code = reading.time_code
        at_s = code.time_s + self._offset_s
        self._known = replace(code, time_s=at_s, source=SOURCE), self._frames.start_s[-1] + self._offset_s


_FIELDS = ("start_s", "labels", "drop")


def _no_frames() -> LtcFrames:
    return LtcFrames(np.zeros(0), np.zeros((0, 4), int), np.zeros(0, bool))


def _some(frames: LtcFrames, wanted: np.ndarray) -> LtcFrames:
    return LtcFrames(*(getattr(frames, name)[wanted] for name in _FIELDS))


def _label(numbers: np.ndarray, like: str) -> str:
    hours, minutes, seconds, frame = numbers.tolist()
    return f"{hours:02d}:{minutes:02d}:{seconds:02d}{like[8]}{frame:02d}"


class ListeningLine:
    """Reads a line's sound on a thread of its own, until it ends or ``close``."""

    def __init__(self, place: str, rate: str | None, *, tell: Callable[[str], None]) -> None:
        """``place``: ``-`` for standard input, or a FIFO. Raises BadInput for any other file."""
        _require_stream(place)
        self._place, self._rate, self._tell = place, rate, tell
        self._line: LtcLine | None = None
        self._stopped = Event()
        Thread(target=self._listen, name="time code of a line", daemon=True).start()

    @property
    def time_code(self) -> TimeCode | None:
        return None if self._line is None else self._line.time_code

    def look(self) -> None:
        """Tell what has changed since the last look."""
        if self._line is not None:
            self._line.look()

    def close(self) -> None:
        """Sound that comes later is not taken; a read that waits for it ends with the process."""
        self._stopped.set()

    def _listen(self) -> None:
        try:
            # raw: a thread that waits in a buffered stream holds its lock when the process ends
            is_input = self._place == STANDARD_INPUT
            with open(0 if is_input else self._place, "rb", buffering=0, closefd=not is_input) as stream:
                self._line = LtcLine(read_form(stream), self._rate, tell=self._tell)
                while not self._stopped.is_set() and (content := stream.read(_READ_BYTES)):
                    self._line.take(content, clock_ns())
        except BadInput as error:
            self._tell(f"No time code is read from {self._named}: {error}.")
            return
        except OSError as error:
            self._tell(f"The sound of {self._named} broke off: {error.strerror}.")
            return
        if not self._stopped.is_set():
            self._tell(f"The sound of {self._named} ended: takes that begin now have no time code of it.")

    @property
    def _named(self) -> str:
        return "standard input" if self._place == STANDARD_INPUT else self._place


def _require_stream(place: str) -> None:
    if place == STANDARD_INPUT:
        if sys.stdin.isatty():
            raise BadInput(
                "--ltc - reads sound from standard input, and nothing is piped into it: "
                "arecord -f S16_LE -r 48000 | glovecal trigger GLOVE --ltc -"
            )
        return
    try:
        mode = Path(place).stat().st_mode
    except OSError:
        raise BadInput(f"there is no {place} to read sound from; make it: mkfifo {place}") from None
    if not (stat.S_ISFIFO(mode) or stat.S_ISCHR(mode)):
        raise BadInput(
            f"{place} is a file, no line: after the recording, glovecal take timecode TAKE --ltc {place}"
        )


def read_form(stream: BinaryIO) -> SoundForm:
    """Of the WAV stream that begins here, up to its samples. Raises BadInput."""
    riff = _exactly(stream, 12)
    if riff[:4] not in (b"RIFF", b"RF64") or riff[8:] != b"WAVE":
        raise BadInput("it does not begin as a WAV stream; let the recorder write WAV (arecord: no -t raw)")
    form: SoundForm | None = None
    while True:
        kind, size = struct.unpack("<4sI", _exactly(stream, 8))
        if kind == b"data":
            break
        if size > _READ_BYTES:
            raise BadInput("its WAV header is damaged; start the recorder again")
        content = _exactly(stream, size + size % 2)
        if kind == b"fmt " and size >= 16:
            tag, channels, samples_per_s, _, _, bits = struct.unpack_from("<HHIIHH", content)
            if tag not in (_PCM, _EXTENSIBLE) or bits not in (8, 16, 24, 32):
                raise BadInput("its samples are not PCM of 8 to 32 bits; record 16-bit WAV (-f S16_LE)")
            form = SoundForm(samples_per_s, channels, bits // 8)
    if form is None:
        raise BadInput("its WAV header says nothing of the samples; start the recorder again")
    if form.samples_per_s < LEAST_SAMPLES_PER_S or not 1 <= form.channels <= _MOST_CHANNELS:
        raise BadInput(
            f"it has {form.channels} channels with {form.samples_per_s} samples a second; record 1 to "
            f"{_MOST_CHANNELS} with {LEAST_SAMPLES_PER_S} or more (-c 1 -r 48000)"
        )
    return form


def _exactly(stream: BinaryIO, size: int) -> bytes:
    content = b""
    while len(content) < size:
        if not (more := stream.read(size - len(content))):
            raise BadInput("it ended before any sound came; is the recorder running?")
        content += more
    return content
