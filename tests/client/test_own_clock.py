"""Own clocks of two gloves: drift and offset from their stamps, aligned within 5 ms for an hour."""

import random
import time
from pathlib import Path

import numpy as np
import pytest

from glovecal_client.capture.cyberglove3.commands import nearest_s, read_clock, set_clock, wall_of_day_s
from glovecal_client.capture.cyberglove3.record import TimedRecordReader
from glovecal_client.capture.device_clock import ClockLine, OwnClock
from glovecal_client.capture.serial_link import SerialLink
from glovecal_client.capture.stream.parser import Counters
from glovecal_service.emulators.cyberglove3 import EmulatedCyberGlove3
from glovecal_service.emulators.glove import Faults
from glovecal_service.emulators.ports import Emulation
from glovecal_service.emulators.pseudo_terminal import PseudoTerminal

HOUR_S = 3600.0
FRAME_S = 1 / 30


class StillHand:
    """Postures do not matter to a clock."""

    def degrees(self, time_s: float) -> dict[str, float]:
        return DEGREES


DEGREES: dict[str, float] = {}


@pytest.fixture(autouse=True)
def posture() -> None:
    from glovecal_service.emulators.hand import MovingHand

    DEGREES.update(MovingHand(0).degrees(1.0))


def an_hour(
    drift: float, offset_s: float, seed: int, multiplier: int, part: float = 1.0
) -> tuple[np.ndarray, OwnClock, np.ndarray]:
    """True times of the records of an hour or a part of it, the clock measured from them, and the stamps.

    The clock is accelerated. Records travel 1 to 17 ms, as over a USB serial adapter with its timer of 16 ms.
    """
    faults = Faults()
    faults.drift, faults.offset_s = drift, offset_s
    glove = EmulatedCyberGlove3(StillHand(), faults)  # type: ignore[arg-type]
    glove.feed(b"1m" + bytes([multiplier]), 0.0)
    glove.feed(b"1S", 1.0)
    reader, chance = TimedRecordReader(Counters(), tuple(range(22))), random.Random(seed)
    rate_hz = 30 * multiplier
    clock, taken, stamps = OwnClock(rate_hz, 86400 * rate_hz), [], []
    while (now_s := glove.next_due_s()) < part * HOUR_S:
        for record in reader.feed(glove.due(now_s)):
            ticks = record.second_of_day * rate_hz + record.frame * multiplier + record.sub_sample
            clock.note(ticks, round(1e9 * (now_s + 0.001 + 0.016 * chance.random())))
            taken.append(now_s)
            stamps.append(ticks / rate_hz)
    return np.array(taken), clock, np.array(stamps)


@pytest.mark.parametrize(("multiplier", "part"), [(1, 0.3), (3, 0.1)])
def test_two_gloves_are_aligned_within_5_ms_over_an_hour(multiplier: int, part: float) -> None:
    """Stamps are 33 ms apart (multiplier 1) or 11 ms; the quartzes 50 ppm apart, 180 ms after an hour."""
    left, right = an_hour(25e-6, 0.31, 1, multiplier, part), an_hour(-25e-6, -7.2, 2, multiplier, part)
    errors = []
    for taken, clock, stamps in (left, right):
        line = clock.line
        assert line is not None
        errors.append(np.asarray(line.monotonic(stamps)) - taken)
        assert line.sd_s < 0.001
    assert left[1].line is not None
    assert right[1].line is not None
    apart = left[1].line.drift - right[1].line.drift
    assert apart == pytest.approx(50e-6, abs=1e-6)
    worst = max(errors[0].max() - errors[1].min(), errors[1].max() - errors[0].min())
    print(f"multiplier {multiplier}: frames aligned within {1e3 * worst:.2f} ms")
    assert worst <= 0.005


def test_the_offset_found_is_that_of_the_clock_within_its_standard_deviation_and_delay() -> None:
    _, clock, _ = an_hour(50e-6, 3.0, 5, 1, 0.25)
    line = clock.line
    assert line is not None
    true_s = 34200.0 + (line.at_s - 0.0) * (1 + 50e-6) + 3.0
    assert 0 <= true_s - line.own_s <= 0.001 + 5 * line.sd_s + 0.001
    assert abs(line.drift - 50e-6) <= 5 * line.drift_sd


def test_a_clock_that_is_set_begins_a_new_line() -> None:
    clock = OwnClock(90.0, 86400 * 90)
    for number in range(3000):
        clock.note(number, number * 11_111_111)
    assert clock.line is not None
    for number in range(3000, 6000):
        clock.note(number + 450, number * 11_111_111)
    assert isinstance(clock.line, ClockLine)
    assert clock.line.own(66.0) == pytest.approx(71.0, abs=0.01)
    assert abs(clock.line.drift) < 1e-6


def ahead(folder: Path, faults: Faults) -> tuple[EmulatedCyberGlove3, PseudoTerminal]:
    """A glove whose clock goes ahead, and its port."""
    faults.offset_s = 0.1234
    glove = EmulatedCyberGlove3(StillHand(), faults)  # type: ignore[arg-type]
    return glove, PseudoTerminal(folder / "emulated-cyberglove3")


def test_answers_of_whole_frames_bound_the_clock_far_below_one(tmp_path: Path) -> None:
    faults = Faults()
    glove, port = ahead(tmp_path, faults)
    with Emulation(glove, port, faults):
        link = SerialLink(port.name, 115200)
        reading = read_clock(link, 30.0)
        true_s = nearest_s(glove.clock_s(time.monotonic()) - wall_of_day_s())
        assert reading.is_consistent
        assert reading.half_width_s < FRAME_S / 4
        assert abs(reading.ahead_s - true_s) <= reading.half_width_s + 0.002
        after, times = set_clock(link, 30.0)
        assert abs(after.ahead_s) <= FRAME_S
        assert times >= 1  # a busy computer's commands come late, and are given again
        link.close()


class DropsQuestions(SerialLink):
    """Every other question about the time is lost on its way."""

    def __init__(self, name: str) -> None:
        super().__init__(name, 115200)
        self.asked = 0

    def write(self, data: bytes) -> None:
        self.asked += data == b"1tg"
        if data != b"1tg" or self.asked % 2 == 0:
            super().write(data)


def test_a_question_that_is_lost_is_asked_again(tmp_path: Path) -> None:
    faults = Faults()
    glove, port = ahead(tmp_path, faults)
    with Emulation(glove, port, faults):
        link = DropsQuestions(port.name)
        reading = read_clock(link, 30.0, wanted_s=FRAME_S)
        true_s = nearest_s(glove.clock_s(time.monotonic()) - wall_of_day_s())
        assert reading.is_consistent
        assert link.asked == 2 * reading.polls
        assert abs(reading.ahead_s - true_s) <= reading.half_width_s + 0.002
        link.close()
