"""Beliefs of all rotations from takes with known angles; where there are none, from rules and ranges.

Shapes are what is known of bend sensors, not what a few angles make likeliest: one sensor by itself is nearly
a line, bent by a few per cent of its range; pulls of neighbours bend a plane more; both do so smoothly. A
joint without a sensor follows its rule, roughly. Of a joint that nobody showed, the readings' range is the
joint's (section 5.2.2).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from glovecal_models.hand.rotations import HAND_ROTATIONS, REST_DEG, RULES
from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG
from glovecal_models.inverse_kinematics.hand_shape import FINGER_SD_DEG, THUMB_SD_DEG
from glovecal_models.layout import Layout
from glovecal_models.sampling.guided.rotation_belief import Prior, RotationBelief, Shape
from glovecal_models.sampling.guided.taught_samples import TaughtSamples, hold_sd_deg
from glovecal_models.simulation.typical_glove import TYPICAL_COUNTS

Ranges = Mapping[str, tuple[float, float]]
"""Lowest and highest reading by sensor."""
BOW_SHARE = 0.03
"""Of a joint's range that a bend sensor's curve is off its line."""
COUPLED_SHARE = 0.15
"""Of it that pulls of neighbours are off a plane."""
WIDGET_SD_DEG = 0.9
"""What is left of the sensors' noise in a frame of a widget, where several of them add up."""
BOW_LENGTH = 0.5
"""Of the range over which the curve changes."""
WIDE_DEG = 300.0
RULE_OFFSET_DEG, RULE_SLOPE_DEG, RULE_BOW_DEG = 1.0, 5.0, 2.0
"""How far a person's joints are from their rule where it says 0, how much more at the end of the range, and
how far from a line: straight fingers are straight, bent ones differ."""
RANGE_SLOPE_DEG = 15.0
"""How far a joint's range on this hand is from the usual."""
MOST_SAMPLES = 300


def first_beliefs(
    layout: Layout,
    samples: TaughtSamples,
    ranges: Ranges,
    only: Iterable[str] | None = None,
) -> dict[str, RotationBelief]:
    """Of every rotation that the hand has or the layout reads, or ``only`` of these."""
    held_sd = hold_sd_deg(samples, layout)
    taught = (name for name in layout.rotations if name in samples.rotations)
    names = dict.fromkeys([*HAND_ROTATIONS, *taught] if only is None else only)
    return {name: _belief(name, layout, samples, ranges, held_sd) for name in names}


def _belief(
    rotation: str,
    layout: Layout,
    samples: TaughtSamples,
    ranges: Ranges,
    held_sd: float,
) -> RotationBelief:
    sensors = layout.correspondence(rotation).sensors if rotation in layout.rotations else ()
    low, high = np.array([ranges[name] for name in sensors]).reshape(-1, 2).T
    middle, span = (low + high) / 2, np.maximum(high - low, 1.0)
    held, held_angles = samples.of_holds(rotation, sensors)
    moved, moved_angles = samples.of_widgets(rotation, sensors)
    if not sensors or not len(held) + len(moved):
        prior = _untaught(rotation, layout, sensors, middle, span)
        return RotationBelief(prior, np.empty((0, len(sensors))), np.empty(0), np.empty(0))
    shape = _bowed(rotation, len(sensors))
    prior = Prior(sensors, middle, span, np.zeros(len(sensors)), 0.0, WIDE_DEG, WIDE_DEG, shape)
    return RotationBelief(
        prior,
        np.concatenate([held, _some(moved)]),
        np.concatenate([held_angles, _some(moved_angles)]),
        np.concatenate([np.full(len(held), held_sd), np.full(len(_some(moved)), WIDGET_SD_DEG)]),
    )


def _untaught(
    rotation: str, layout: Layout, sensors: tuple[str, ...], middle: np.ndarray, span: np.ndarray
) -> Prior:
    """From the rule, else from the range."""
    count = len(sensors)
    firmness = THUMB_SD_DEG if rotation.startswith("T") else FINGER_SD_DEG
    nothing = np.zeros(count)
    if rotation in RULES and (not sensors or layout.correspondence(rotation).simulated):
        bow = _squared_exponential(RULE_BOW_DEG, count)
        offset, slope = RULE_OFFSET_DEG, RULE_SLOPE_DEG
        straight = middle - span / 2
        return Prior(sensors, straight, span, nothing, 0.0, offset, slope, bow, RULES[rotation])
    if not sensors:
        rest = REST_DEG[rotation]
        still = _squared_exponential(0.0, 0)
        return Prior((), middle, span, nothing, rest, 0.0, 0.0, still, frame_sd_deg=firmness)
    low, high = ACTIVE_RANGE_DEG[rotation]
    slope = nothing.copy()
    slope[0] = (high - low) * (-1.0 if TYPICAL_COUNTS.get(sensors[0], (0.0, 1.0))[1] < 0 else 1.0)
    shape = _bowed(rotation, count)
    return Prior(sensors, middle, span, slope, (low + high) / 2, firmness, RANGE_SLOPE_DEG, shape)


def _bowed(rotation: str, count: int) -> Shape:
    low, high = ACTIVE_RANGE_DEG.get(rotation, (0.0, 90.0))
    return _squared_exponential((COUPLED_SHARE if count > 1 else BOW_SHARE) * (high - low), count)


def _squared_exponential(size_deg: float, count: int) -> Shape:
    def shape(x: np.ndarray, z: np.ndarray) -> np.ndarray:
        apart = (x[:, None, :count] - z[None, :, :count]) / BOW_LENGTH
        return size_deg**2 * np.exp(-0.5 * np.einsum("nmd,nmd->nm", apart, apart))

    return shape


def _some(rows: np.ndarray) -> np.ndarray:
    """At most about ``MOST_SAMPLES``, evenly in time: neighbours are alike."""
    return rows[:: max(1, -(-len(rows) // MOST_SAMPLES))]


def reading_ranges(sensors: Sequence[str], readings: np.ndarray) -> dict[str, tuple[float, float]]:
    """Lowest and highest of ``readings`` (N, S) by sensor."""
    low, high = readings.min(axis=0), readings.max(axis=0)
    return {name: (float(low[index]), float(high[index])) for index, name in enumerate(sensors)}
