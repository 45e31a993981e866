"""Hum: one sensor's readings carry a tone of constant frequency that its joint does not move with.

A broken shield lets in the mains, or a switching supply, which the frame rate folds down to some hertz. A
tone is one sharp line in the spectrum; movement, tremor and every other effect are wide. The spectrum of the
errors is averaged over pieces of takes (Bartlett 1950), and a line must stand out from the median around it.
It must be in the readings, or else the reference hums; not in the joint's angle, or else the joint moves with
it (a machine, a vibrating tool) and the sensor follows too weakly or too late; and not in other sensors, or
else no sensor fails. Pieces in which a joint swings to and fro are left out: what a bend of a sensor, a delay
or a neighbour makes of its swings are lines too, at multiples of their frequency.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.effects.sensor_fault.reading_errors import ReadingErrors

PIECE_S = 8.0
FEWEST_PIECES = 4
SLOWEST_HZ = 4.0
"""Below, hands move."""
AROUND_BINS = 20
FEWEST_FRAMES = 8 * AROUND_BINS
OVER_AROUND = 8.0
"""Times the median: noise averaged over four pieces gets there once in 10^9."""
LINE_BINS = 2
"""To either side: the width of a tone seen through a Hann window."""
NARROW_BINS = (4, 8)
NARROW_SHARE = 0.125
"""Of the line, which half a hertz to a hertz beside it may be left: a tremor is wider."""
LEAST_HUM_DEG = 0.25
IN_READINGS = 0.5
"""Of the line's power in the errors: the readings must have it."""
IN_ANGLE = 0.25
"""Of the line's power in the errors, which the joint's angle may have at most."""
SWING_HZ, SWING_DEG = 1.5, 3.0
"""A joint swings where this frequency or a higher one is its strongest, with so many degrees RMS in all: free
motion has its strongest below 0.7 Hz, fast swings at 2 to 3.5 Hz (simulated)."""
OTHERS_SHARE = 0.25
"""Of the other sensors, which may have the line too."""


@dataclass(frozen=True)
class Hum:
    """A tone in one sensor's readings."""

    frequency_hz: float
    """As the frames show it, after folding."""
    rms_deg: float
    over_around: float
    """Power over the median around it."""
    heard_s: float
    """So long were the pieces together."""


def hums(sensors: Sequence[ReadingErrors | None]) -> list[Hum | None]:
    """For each sensor its strongest tone."""
    swings = _swinging([each for each in sensors if each is not None])
    found = [None if each is None else _tone(each, swings) for each in sensors]
    return [
        None if tone is None or _is_common(tone, found[:place] + found[place + 1 :]) else tone
        for place, tone in enumerate(found)
    ]


def _is_common(tone: Hum, others: Sequence[Hum | None]) -> bool:
    step_hz = LINE_BINS / PIECE_S
    alike = [each for each in others if each and abs(each.frequency_hz - tone.frequency_hz) <= step_hz]
    return len(alike) > OTHERS_SHARE * len(others)


def _swinging(sensors: Sequence[ReadingErrors]) -> np.ndarray:
    """(J,) for each whole piece of the takes: whether any joint swings in it."""
    found = np.zeros(0, dtype=bool)
    for sensor in sensors:
        frames = _frames(sensor)
        if frames < FEWEST_FRAMES:
            continue
        angles = np.concatenate([_pieces(part, frames) for part in sensor.angles])
        power = _power(np.nan_to_num(angles), np.hanning(frames))
        strongest_hz = np.fft.rfftfreq(frames, 1.0 / sensor.rate_hz)[power.argmax(axis=1)]
        swings = (strongest_hz >= SWING_HZ) & (np.nan_to_num(angles).std(axis=1) >= SWING_DEG)
        found = swings | (found if len(found) else False)
    return found


def _frames(sensor: ReadingErrors) -> int:
    return 2 * round(PIECE_S * sensor.rate_hz / 2)


def _tone(sensor: ReadingErrors, swings: np.ndarray) -> Hum | None:
    frames = _frames(sensor)
    if frames < FEWEST_FRAMES:
        return None
    window = np.hanning(frames)
    whole = [_pieces(part, frames) for part in sensor.errors]
    errors = np.concatenate(whole)
    measured = np.isfinite(errors).all(axis=1) & ~swings
    if measured.sum() < FEWEST_PIECES:
        return None
    power = _spectrum(errors[measured], window)
    around = _around(power)
    frequency = np.fft.rfftfreq(frames, 1.0 / sensor.rate_hz)
    over = np.where(frequency >= SLOWEST_HZ, power / np.maximum(around, 1e-12), 0.0)
    at = int(over.argmax())
    line = slice(max(at - LINE_BINS, 0), at + LINE_BINS + 1)
    # Half of what is at the highest frequency belongs to the other, folded half of the spectrum.
    weight = np.where(frequency[line] == frequency[-1], 1.0, 2.0)
    mean_square = float(np.sum(weight * (power - around)[line])) / (frames * float(np.sum(window**2)))
    in_readings, in_angle = (
        _spectrum(np.concatenate([_pieces(part, frames) for part in parts])[measured], window)
        for parts in (sensor.readings, sensor.angles)
    )
    near, far = NARROW_BINS
    padded = np.pad(power, far, mode="reflect")
    beside = np.concatenate([padded[at : at + far - near + 1], padded[at + far + near : at + 2 * far + 1]])
    is_tone = (
        over[at] >= OVER_AROUND
        and mean_square >= LEAST_HUM_DEG**2
        and beside.mean() <= NARROW_SHARE * power[at]
        and in_readings[line].sum() >= IN_READINGS * power[line].sum()
        and (in_angle - _around(in_angle))[line].sum() <= IN_ANGLE * power[line].sum()
    )
    if not is_tone:
        return None
    heard_s = float(measured.sum()) * PIECE_S
    return Hum(float(frequency[at]), float(np.sqrt(mean_square)), float(over[at]), heard_s)


def _around(power: np.ndarray) -> np.ndarray:
    """(F,) median around each frequency."""
    padded = np.pad(power, AROUND_BINS, mode="reflect")
    return np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * AROUND_BINS + 1), axis=1)


def _pieces(values: np.ndarray, frames: int) -> np.ndarray:
    """(J, frames), the whole pieces of (N,)."""
    return values[: len(values) // frames * frames].reshape(-1, frames)


def _spectrum(pieces: np.ndarray, window: np.ndarray) -> np.ndarray:
    """(F,) mean power of the pieces (J, N) without their straight lines."""
    return np.mean(_power(pieces, window), axis=0)


def _power(pieces: np.ndarray, window: np.ndarray) -> np.ndarray:
    """(J, F) of each of the pieces (J, N) without its straight line."""
    place = np.arange(len(window)) - (len(window) - 1) / 2
    slope = pieces @ place / float(place @ place)
    level = pieces - pieces.mean(axis=1, keepdims=True) - slope[:, None] * place
    return np.abs(np.fft.rfft(level * window)) ** 2
