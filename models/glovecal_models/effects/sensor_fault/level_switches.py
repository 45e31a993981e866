"""Level switches: one sensor's readings change by themselves between levels, and back.

A cold solder joint sits in one of two states and changes between them at random (random telegraph signal); a
cracked track parts in a bend and closes again. From one frame to the next the reading goes elsewhere, its
joint does not. Against the curve of the joint's own angle such a switch is a step between two means; what a
movement leaves of another effect is a slope there, which takes many frames. A step also tells by a least
squares fit beside a slope: of a switch all is left, of a slope nothing. The step must be in the readings, or
else the reference switches (swapped markers).

Switches to and fro take turns, and the other sensors have none: a cloth that slips, a frame that is repeated,
a touch move more than one. What charges up, sparks or loses a bit jumps without taking turns: there the steps
must be sharper. A strip of the glove that snaps over takes turns too, but goes over at one angle and back at
another, which is hysteresis; a contact opens and closes at the same angles. A converter whose steps are
unequal jumps with every passage of a reading and makes up for it between: that is a curve of the sensor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.effects.sensor_fault.reading_errors import ReadingErrors

SIDE_S, SIDE_FRAMES = 0.12, 4
"""Each mean is over so long, and at least so many frames."""
SPREADS = 4.0
"""Times the robust spread of the differences of means."""
LEAST_SWITCH_DEG = 1.0
FEWEST_SWITCHES = 12
SWITCH_SHARE = 0.75
"""Of the difference of means, which the step beside a slope must be."""
READING_SHARE = 0.65
"""Of the difference of means, which the readings' own step beside a slope must be. On 414 simulated gloves
with other effects of 1.3 to 5.2 noise floors it was at most 0.6, but for strips that snap over and for
repeated frames."""
TURNS = 0.65
"""Share of the switches that go the other way than the one before; half would be chance."""
FEWEST_SHARP, SHARP_SHARE, SHARP_READING_SHARE, SHARP_APART_SE = 25, 0.85, 0.8, 2.5
"""The same for those that do not take turns. Of 576 simulated gloves with one effect of 1.3 or 2.6 noise
floors only faults had such jumps in one sensor."""
LARGEST_SHARE = 1.25
"""Of the difference of means: a step that is larger is made up for on its two sides."""
OTHERS_SWITCHES, OTHERS_SHARE = 0.25, 0.25
"""At most this share of the other sensors may have more than this share of the switches."""
MOST_MOVED = 10.0
"""Times a switch's height, in the median: by so much the joint itself may move meanwhile. Where poses follow
each other at once, what the curve misses of each pose steps with the joint: 22 times in two simulated
sound gloves, at most once in 18 with loose contacts, sparks and cracks, 7 times in a track that parts in deep
bends (2026-11-28)."""
APART_SE = 5.0
"""Standard errors between the mean angles of switches up and down: with more a strip snaps over. Of 16
simulated gloves with such a strip 15 had 10 or more; of 16 with a contact none had more than 1.5."""


@dataclass(frozen=True)
class LevelSwitches:
    """Of one sensor."""

    count: int
    size_deg: float
    """Their mean height."""
    take_turns: bool
    """Whether they go to and fro between levels."""


@dataclass(frozen=True)
class _Candidates:
    heights: list[np.ndarray]
    """For each take the differences of means, degrees."""
    angles: np.ndarray
    """(C,) of the joint in the middle, degrees."""
    step_share: float
    reading_share: float
    moved_share: float
    """Median of how far the joint itself moves meanwhile, of the switch's height."""

    @property
    def count(self) -> int:
        return sum(map(len, self.heights))

    @property
    def size_deg(self) -> float:
        return float(np.mean(np.abs(np.concatenate(self.heights))))

    @property
    def turns(self) -> float:
        pairs = [np.sign(each[1:]) != np.sign(each[:-1]) for each in self.heights]
        every = np.concatenate(pairs)
        return float(every.mean()) if len(every) else 0.0

    @property
    def apart_se(self) -> float:
        """Between the mean angles of switches up and down, standard errors."""
        goes_up = np.concatenate(self.heights) > 0
        up, down = self.angles[goes_up], self.angles[~goes_up]
        if not len(up) or not len(down):
            return 0.0
        error = np.sqrt(up.var() / len(up) + down.var() / len(down))
        return float(abs(up.mean() - down.mean()) / max(error, 1e-9))

    @property
    def take_turns(self) -> bool:
        return (
            self.count >= FEWEST_SWITCHES
            and self.step_share >= SWITCH_SHARE
            and self.reading_share >= READING_SHARE
            and self.turns >= TURNS
            and self.apart_se <= APART_SE
        )

    @property
    def are_sharp(self) -> bool:
        return (
            self.count >= FEWEST_SHARP
            and self.step_share >= SHARP_SHARE
            and self.reading_share >= SHARP_READING_SHARE
            and self.apart_se <= SHARP_APART_SE
        )

    @property
    def are_switches(self) -> bool:
        is_large = self.size_deg >= LEAST_SWITCH_DEG and self.step_share <= LARGEST_SHARE
        return is_large and self.moved_share <= MOST_MOVED and (self.take_turns or self.are_sharp)


def level_switches(sensors: Sequence[ReadingErrors | None]) -> list[LevelSwitches | None]:
    """For each sensor its switches, None where they are no fault of its own."""
    found = [None if each is None else _candidates(each) for each in sensors]
    counts = np.array([0 if each is None else each.count for each in found])
    result: list[LevelSwitches | None] = []
    for place, each in enumerate(found):
        others = np.delete(counts, place)
        many = int((others > OTHERS_SWITCHES * counts[place]).sum())
        is_own = each is not None and each.are_switches and many <= OTHERS_SHARE * len(others)
        result.append(LevelSwitches(each.count, each.size_deg, each.take_turns) if each and is_own else None)
    return result


def _candidates(sensor: ReadingErrors) -> _Candidates | None:
    from scipy.ndimage import maximum_filter1d  # slow to load, and every model with effects loads this file

    side = max(SIDE_FRAMES, round(SIDE_S * sensor.rate_hz))
    place = np.arange(2 * side) - (side - 0.5)
    means = np.where(place > 0, 1.0, -1.0) / side
    beside_slope = np.linalg.pinv(np.column_stack([np.ones(2 * side), place, (place > 0)]))[2]
    long = [take for take in range(len(sensor.errors)) if len(sensor.errors[take]) >= 2 * side]
    if not long:
        return None
    differences = [np.correlate(sensor.errors[take], means, "valid") for take in long]
    known = np.abs(np.concatenate(differences))
    known = known[np.isfinite(known)]
    if not len(known):
        return None
    limit = SPREADS * 1.4826 * float(np.median(known))
    heights, angles, steps, reading_steps, moved = [], [], [], [], []
    for take, height in zip(long, differences, strict=True):
        size = np.where(np.isfinite(height), np.abs(height), 0.0)
        around = maximum_filter1d(size, 2 * side + 1, mode="constant")
        peaks = np.flatnonzero((size > limit) & (size >= around))
        heights.append(height[peaks])
        for at in peaks:
            way, inside = np.sign(height[at]), slice(at, at + 2 * side)
            angles.append(sensor.angles[take][at + side - 1 : at + side + 1].mean())
            steps.append(way * (beside_slope @ sensor.errors[take][inside]))
            reading_steps.append(way * (beside_slope @ sensor.readings[take][inside]))
            moved.append(abs((means @ sensor.angles[take][inside]) / height[at]))
    if not steps:
        return None
    size_deg = float(np.mean(np.abs(np.concatenate(heights))))
    shares = float(np.mean(steps)) / size_deg, float(np.mean(reading_steps)) / size_deg
    return _Candidates(heights, np.array(angles), *shares, float(np.median(moved)))


# Hum: one sensor's readings carry a tone of constant frequency that its joint does not move with. A broken
# shield lets in the mains, or a switching supply, which the frame rate folds down to some hertz. A tone is
# one sharp line in the spectrum; movement, tremor and every other effect are wide. The spectrum of the
# errors is averaged over pieces of takes (Bartlett 1950), and a line must stand out from the median around
# it. It must be in the readings, or else the reference hums; not in the joint's angle, or else the joint
# moves with it (a machine, a vibrating tool) and the sensor follows too weakly or too late; and not in
# other sensors, or else no sensor fails. Pieces in which a joint swings to and fro are left out: what a
# bend of a sensor, a delay or a neighbour makes of its swings are lines too, at multiples of their
# frequency.


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
ALIKE_SHARE = 0.25
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
    return len(alike) > ALIKE_SHARE * len(others)


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
