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
        return is_large and (self.take_turns or self.are_sharp)


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
    heights, angles, steps, reading_steps = [], [], [], []
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
    if not steps:
        return None
    size_deg = float(np.mean(np.abs(np.concatenate(heights))))
    return _Candidates(
        heights, np.array(angles), float(np.mean(steps)) / size_deg, float(np.mean(reading_steps)) / size_deg
    )
