"""What is believed of each rotation's calibration, from takes with known angles, from rules and from ranges.

A posterior is a process over readings: the paper's covariance (Wang & Neff 2013, equation 8) with a plane so
wide that data alone decide it. Unlike a trained regressor it knows how its errors in different frames go
together: a wrong gain is wrong in every frame. That is what lets fingertips that touch in many frames correct
it (``touch_posterior.py``).

Shapes are what is known of bend sensors, not what a few angles make likeliest: one sensor by itself is nearly
a line, bent by a few per cent of its range; pulls of neighbours bend a plane more; both do so smoothly. A
joint without a sensor follows its rule, roughly. Of a joint that nobody showed, the readings' range is the
joint's (section 5.2.2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import cho_solve, cholesky

from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, HAND_ROTATIONS, REST_DEG, RULES
from glovecal_models.layout import Layout
from glovecal_models.sampling.guided.labelled_takes import LabelledFrames, hold_sd_deg
from glovecal_models.sampling.inverse_kinematics.follow import FINGER_SD_DEG, THUMB_SD_DEG
from glovecal_models.typical_counts import TYPICAL_COUNTS

Shape = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Covariance (N, M), degrees squared, of what is not a plane, at inputs (N, D) and (M, D) in shares."""


@dataclass(frozen=True)
class Prior:
    """Before any sample; inputs in shares of the sensor's range, about its middle."""

    sensors: tuple[str, ...]
    middle: np.ndarray
    """(D,), counts."""
    span: np.ndarray
    """(D,), counts."""
    slope_deg: np.ndarray
    """(D,), mean slope over the range."""
    mean_deg: float
    """In the middle of the range."""
    offset_sd_deg: float
    slope_sd_deg: float
    shape: Shape
    follows: dict[str, float] = field(default_factory=dict)
    """Weights of the rotations that it follows; the posterior is then of what the rule misses."""
    frame_sd_deg: float = 0.6
    """What is new in each frame: sensors' noise, or a joint that no sensor reads."""

    def inputs(self, readings: np.ndarray) -> np.ndarray:
        """Of raw counts (N, D)."""
        return (readings - self.middle) / self.span

    def mean(self, x: np.ndarray) -> np.ndarray:
        return self.mean_deg + x @ self.slope_deg

    def covariance(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        return self.offset_sd_deg**2 + self.slope_sd_deg**2 * (x @ z.T) + self.shape(x, z)


class RotationPosterior:
    """``prior`` after samples: readings (N, D) raw counts, angles (N,) and their errors (N,), degrees."""

    def __init__(self, prior: Prior, readings: np.ndarray, angles: np.ndarray, sd: np.ndarray) -> None:
        self.prior = prior
        self.samples = len(angles)
        self._x = prior.inputs(readings)
        self._root = cholesky(prior.covariance(self._x, self._x) + np.diag(sd**2), lower=True)
        self._weights = cho_solve((self._root, True), angles - prior.mean(self._x))

    def mean(self, readings: np.ndarray) -> np.ndarray:
        """(N,), degrees, at raw counts (N, D)."""
        x = self.prior.inputs(readings)
        return self.prior.mean(x) + self.prior.covariance(x, self._x) @ self._weights

    def covariance(self, readings: np.ndarray, others: np.ndarray) -> np.ndarray:
        """(N, M), degrees squared, of the errors at two sets of raw counts."""
        x, z = self.prior.inputs(readings), self.prior.inputs(others)
        explained = self.prior.covariance(x, self._x) @ cho_solve(
            (self._root, True), self.prior.covariance(self._x, z)
        )
        return self.prior.covariance(x, z) - explained

    def variance(self, readings: np.ndarray) -> np.ndarray:
        """(N,): the diagonal of ``covariance``."""
        blocks = [readings[start : start + 200] for start in range(0, len(readings), 200)]
        diagonals = [np.diag(self.covariance(block, block)) for block in blocks]
        return np.maximum(np.concatenate([np.empty(0), *diagonals]), 0.0)


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


def first_posteriors(
    layout: Layout,
    samples: LabelledFrames,
    ranges: Ranges,
    only: Iterable[str] | None = None,
) -> dict[str, RotationPosterior]:
    """Of every rotation that the hand has or the layout reads, or ``only`` of these."""
    held_sd = hold_sd_deg(samples, layout)
    labelled = (name for name in layout.rotations if name in samples.rotations)
    names = dict.fromkeys([*HAND_ROTATIONS, *labelled] if only is None else only)
    return {name: _belief(name, layout, samples, ranges, held_sd) for name in names}


def _belief(
    rotation: str,
    layout: Layout,
    samples: LabelledFrames,
    ranges: Ranges,
    held_sd: float,
) -> RotationPosterior:
    sensors = layout.correspondence(rotation).sensors if rotation in layout.rotations else ()
    low, high = np.array([ranges[name] for name in sensors]).reshape(-1, 2).T
    middle, span = (low + high) / 2, np.maximum(high - low, 1.0)
    held, held_angles = samples.of_holds(rotation, sensors)
    moved, moved_angles = samples.of_widgets(rotation, sensors)
    if not sensors or not len(held) + len(moved):
        prior = _unlabelled(rotation, layout, sensors, middle, span)
        return RotationPosterior(prior, np.empty((0, len(sensors))), np.empty(0), np.empty(0))
    shape = _bowed(rotation, len(sensors))
    prior = Prior(sensors, middle, span, np.zeros(len(sensors)), 0.0, WIDE_DEG, WIDE_DEG, shape)
    return RotationPosterior(
        prior,
        np.concatenate([held, _some(moved)]),
        np.concatenate([held_angles, _some(moved_angles)]),
        np.concatenate([np.full(len(held), held_sd), np.full(len(_some(moved)), WIDGET_SD_DEG)]),
    )


def _unlabelled(
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
