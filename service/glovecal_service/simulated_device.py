"""Capture device ``simulated``: a simulated hand in a simulated CyberGlove, for trials and demonstrations.

Nothing it sends was measured; every frame is marked as simulated. With ``reference=FILE`` it also writes
what a perfect but noisy reference system would have measured at each frame, as a reference table. With
``motion=asked`` it does what the open sampling of the service at ``service=URL`` asks.
"""

from __future__ import annotations

import math
import threading
import time
import weakref
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any, TextIO, TypeVar

import numpy as np

from glovecal_client.capture.device import Reading, check_options
from glovecal_client.clock import clock_ns, wall_ns
from glovecal_client.errors import BadOption, ClientError, DeviceFinished, DeviceLost
from glovecal_client.rest import RestClient
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.sampling.protocol import Step
from glovecal_models.simulation.protocol import MOTIONS, Segment, free_segment, segments
from glovecal_models.simulation.simulated_glove import (
    LAYOUTS,
    REFERENCE_NOISE_DEG,
    Performance,
    SimulatedGlove,
    duration_s,
    measured_rotations,
)
from glovecal_models.simulation.simulated_hand import DRIVEN, ROTATIONS, SimulatedHand
from glovecal_models.simulation.touching import AskedHand, PreparedTouches, RealTouches

# A simulated person who looks at the page of the service: does what the open sampling asks, else rests.


DEFAULT_SERVICE = "http://127.0.0.1:8600"
LOOK_EVERY_S = 0.15
RESTING = ("paused", "done", "stopped")


class SimulatedSubject:
    """Rotations as a function of time that only goes on; what is asked is looked up in a thread.

    The newest open sampling counts. While the service does not answer, the person goes on with the last step.
    The hand is a usual one, 190 mm long.
    """

    def __init__(
        self, hand: SimulatedHand, rotations: Sequence[str], seed: int, wearing: int, service: str
    ) -> None:
        """Raises BadName for an address that is none."""
        RestClient(service).close()
        self._rules = hand
        number = seed + 1_000_003 * wearing
        self.touches = PreparedTouches(RealTouches(hand, hand_skeleton()), number)
        self._hand = AskedHand(number, self.touches)
        self._order = [ROTATIONS.index(rotation) for rotation in rotations]
        self.asked: Step | None = None
        threading.Thread(target=_look, args=(weakref.ref(self), service), daemon=True).start()

    def at(self, time_s: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
        """Angles, shape (N, len(rotations)), degrees, and pose names at increasing times (N,)."""
        step = self.asked
        self._hand.ask(step, float(time_s[0]))
        driven = self._hand.driven(time_s)
        angles = self._rules.complete(dict(zip(DRIVEN, driven.T, strict=True)))
        return angles[:, self._order], (step.pose if step else "",) * len(time_s)


def _look(person: weakref.ref[SimulatedSubject], service: str) -> None:
    """As long as the person is there."""
    with RestClient(service, patience_s=5.0) as client:
        while (there := person()) is not None:
            with suppress(ClientError):  # the service may be starting; look again
                asked = _asked(client.get("/sampling", {"only_open": True}))
                if asked is not None:
                    there.touches.prepare(asked)
                there.asked = asked
            del there
            time.sleep(LOOK_EVERY_S)


def _asked(samplings: list[dict[str, Any]]) -> Step | None:
    if not samplings or samplings[0]["step"] is None or samplings[0]["phase"] in RESTING:
        return None
    asked = {name: value for name, value in samplings[0]["step"].items() if name != "place"}
    return Step.from_document({**asked, "part": ""})


FASTEST_HZ = 1000.0
ASKED = "asked"
_FRAMES_AT_ONCE = 32
_FREE_PART_S = 20.0
LATE_S = 1.0
"""A frame this late is left out, as it would be by a glove whose computer was asleep."""
_NS = 1_000_000_000
_Number = TypeVar("_Number", int, float)
OPTION_HELP = {
    "seed": "N (0; another is another glove)",
    "layout": f"{'|'.join(LAYOUTS)} (cyberglove18)",
    "motion": f"{'|'.join((*MOTIONS, ASKED))} (free)",
    "service": f"URL, where motion=asked asks ({DEFAULT_SERVICE})",
    "hand": "right|left (right)",
    "wearing": "N (0; another is another donning)",
    "rate_hz": f"HZ, 1 to {FASTEST_HZ:g} (120)",
    "reference": "FILE, reference angles are written there",
    "reference_noise_deg": f"DEGREES ({REFERENCE_NOISE_DEG:g})",
    "duration": "SECONDS (free and asked motion: for ever)",
}


@dataclass(frozen=True)
class SimulationOptions:
    """What is simulated, for whom, and for how long."""

    seed: int = 0
    layout: str = "cyberglove18"
    motion: str = "free"
    service: str = DEFAULT_SERVICE
    """Where it is asked, with ``motion="asked"``."""
    hand: str = "right"
    """A left one reads as its mirror image."""
    wearing: int = 0
    rate_hz: float = 120.0
    reference: Path | None = None
    reference_noise_deg: float = REFERENCE_NOISE_DEG
    """Standard deviation of the reference system's noise; 0 writes the truth."""
    duration_s: float | None = None

    @classmethod
    def parse(cls, options: Mapping[str, str]) -> SimulationOptions:
        """From the texts that ``OPTION_HELP`` describes. Raises BadOption."""
        check_options("simulated", options, OPTION_HELP)
        duration = options.get("duration")
        reference = options.get("reference")
        return cls(
            seed=_number(options, "seed", 0, int, 0, 2**32),
            layout=_choice(options, "layout", "cyberglove18", LAYOUTS),
            motion=_choice(options, "motion", "free", (*MOTIONS, ASKED)),
            service=options.get("service", DEFAULT_SERVICE),
            hand=_choice(options, "hand", "right", ("right", "left")),
            wearing=_number(options, "wearing", 0, int, 0, 2**32),
            rate_hz=_number(options, "rate_hz", 120.0, float, 1.0, FASTEST_HZ),
            reference=None if reference is None else Path(reference),
            reference_noise_deg=_number(
                options, "reference_noise_deg", REFERENCE_NOISE_DEG, float, 0.0, 90.0
            ),
            duration_s=None if duration is None else _number(options, "duration", 0.0, float, 0.0, 1e9),
        )


class SimulatedDevice:
    """Gives the frames of a simulated glove, frame ``i`` at ``i / rate_hz`` after ``open``.

    Free and asked motion go on for ever, any other ends when it was done once; with a duration both last that
    long. Opened again it goes through the same motion from the start.
    """

    simulated = True
    option_help = OPTION_HELP
    usage = "simulated"
    about = "No glove: a simulated hand in a simulated CyberGlove."
    context: tuple[str, ...] = ()

    def __init__(self, options: SimulationOptions | None = None) -> None:
        """Raises BadOption if the reference file exists already or cannot be written there."""
        self._options = options or SimulationOptions()
        self._glove = self._new_glove()
        self.name = f"simulated:{self._options.motion}"
        self.hand = self._options.hand
        self.layout = self._glove.layout.name
        self.sensors = self._glove.sensors
        self.rate_hz = self._options.rate_hz
        self.counts = self._glove.layout.counts
        self._reference = None
        if self._options.reference is not None:
            noise = self._options.reference_noise_deg
            self._reference = _ReferenceFile(self._options.reference, self._glove, noise)
        self._frames: Iterator[_SimulatedFrame] | None = None
        self._waiting: _SimulatedFrame | None = None

    @classmethod
    def from_options(cls, argument: str | None, options: Mapping[str, str]) -> SimulatedDevice:
        """``simulated`` with the options of ``SimulationOptions.parse``. Raises BadOption."""
        if argument:
            raise BadOption(
                f"device simulated takes no argument, not {argument!r}; use options such as motion=wrist"
            )
        return cls(SimulationOptions.parse(options))

    def open(self) -> None:
        """Start from the beginning."""
        if self._reference is not None:
            self._reference.open()
        self._glove = self._new_glove()
        self._frames = self._simulate()
        self._waiting = next(self._frames)
        self._started_ns = clock_ns()

    def close(self) -> None:
        """Stop; ``open`` starts from the beginning again."""
        self._frames = None
        if self._reference is not None:
            self._reference.close()

    def read(self, timeout_s: float) -> Reading | None:
        """The next frame when its time has come. Raises DeviceFinished at the end of the motion."""
        if self._frames is None:
            raise DeviceLost(f"{self.name}: not open")
        if self._waiting is None:
            self._waiting = self._next_in_time(self._frames)
        remaining = self._due_ns(self._waiting) - clock_ns()
        if remaining > timeout_s * _NS:
            time.sleep(timeout_s)
            return None
        if remaining > 0:
            time.sleep(remaining / _NS)
        frame, self._waiting = self._waiting, None
        reading = Reading(frame.readings, clock_ns(), wall_ns())
        if self._reference is not None:
            self._reference.write(reading.monotonic_ns, frame)
        return reading

    def _new_glove(self) -> SimulatedGlove:
        return SimulatedGlove(self._options.seed, self._options.layout, wearing=self._options.wearing)

    def _due_ns(self, frame: _SimulatedFrame) -> int:
        return self._started_ns + round(frame.number * _NS / self.rate_hz)

    def _next_in_time(self, frames: Iterator[_SimulatedFrame]) -> _SimulatedFrame:
        """The next frame that is not too late to be worth sending."""
        for frame in frames:
            if clock_ns() - self._due_ns(frame) < LATE_S * _NS:
                return frame
        raise DeviceFinished(f"{self.name}: the motion is over")

    def _simulate(self) -> Iterator[_SimulatedFrame]:
        """All frames, worked out a few at a time."""
        glove, options = self._glove, self._options
        if options.motion == ASKED:
            planned, performance = (
                iter(()),
                SimulatedSubject(glove.hand, glove.rotations, options.seed, options.wearing, options.service),
            )
        else:
            planned = _planned_segments(options)
            performance = Performance(glove.hand, planned, glove.rotations)
        last_s = options.duration_s
        if last_s is None and isinstance(planned, list):
            last_s = duration_s(planned)
        frames = math.inf if last_s is None else max(round(last_s * options.rate_hz), 1)
        first = 0
        while first < frames:
            numbers = np.arange(first, min(first + _FRAMES_AT_ONCE, frames))
            truth, poses = performance.at(numbers / options.rate_hz)
            readings = glove.readings(truth).astype(np.float32)
            for index, number in enumerate(numbers.tolist()):
                yield _SimulatedFrame(int(number), readings[index], truth[index], poses[index])
            first += len(numbers)


@dataclass(frozen=True, eq=False)
class _SimulatedFrame:
    number: int
    readings: np.ndarray
    truth: np.ndarray
    pose: str


def _planned_segments(options: SimulationOptions) -> list[Segment] | Iterator[Segment]:
    """The motion once, or for ever: free motion, and any other that is to fill a duration."""
    seed = options.seed + 1_000_003 * options.wearing  # each wearing moves a little differently
    if options.motion == "free":
        return (free_segment(seed, _FREE_PART_S, part) for part in count())
    if options.duration_s is None:
        return segments(options.motion, seed)
    return (segment for again in count() for segment in segments(options.motion, seed + 7919 * again))


class _ReferenceFile:
    """A reference table written line by line: time of the frame, pose, measured rotations."""

    def __init__(self, path: Path, glove: SimulatedGlove, noise_deg: float) -> None:
        if path.exists():
            raise BadOption(f"simulated: reference={path} exists already; name a new file")
        if not path.parent.is_dir():
            raise BadOption(f"simulated: reference={path}: there is no folder {path.parent}")
        self._path = path
        self._noise_deg = noise_deg
        measured = measured_rotations(glove)
        self._columns = [glove.rotations.index(rotation) for rotation in measured]
        self._header = ",".join(["time_s", "pose", *(f"r.{rotation}" for rotation in measured)])
        self._random = np.random.default_rng([glove.seed, 31, glove.wearing])
        self._stream: TextIO | None = None

    def open(self) -> None:
        """Begin the table, or go on with it after the device was closed."""
        if self._stream is None:
            begun = self._path.exists()
            self._stream = self._path.open("a", encoding="utf-8", buffering=1)
            if not begun:
                self._stream.write(self._header + "\n")

    def close(self) -> None:
        if self._stream is not None:
            self._stream.close()
            self._stream = None

    def write(self, monotonic_ns: int, frame: _SimulatedFrame) -> None:
        """One row, on disk before the next frame; digits beyond a thousandth of a degree are noise."""
        if self._stream is None:
            return
        noise = self._noise_deg * self._random.standard_normal(len(self._columns))
        angles = (frame.truth[self._columns] + noise).round(4).tolist()
        self._stream.write(",".join([repr(monotonic_ns / 1e9), frame.pose, *map(repr, angles)]) + "\n")


def _choice(options: Mapping[str, str], key: str, otherwise: str, choices: tuple[str, ...]) -> str:
    value = options.get(key, otherwise)
    if value not in choices:
        raise BadOption(f"simulated: {key}={value!r} must be one of {', '.join(choices)}")
    return value


def _number(
    options: Mapping[str, str], key: str, otherwise: _Number, kind: type[_Number], low: float, high: float
) -> _Number:
    text = options.get(key, str(otherwise))
    try:
        value = kind(text)
    except ValueError:
        value = None
    if value is None or not low <= value <= high:
        what = "a whole number" if kind is int else "a number"
        raise BadOption(f"simulated: {key}={text!r} must be {what} from {low:g} to {high:g}")
    return value
