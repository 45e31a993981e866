"""Samples of one rotation: the paper's tuples (readings, observed rotation), gathered from takes.

Takes are long and neighbours in time are alike, so a fit uses a representative set: the space of inputs and
target is cut into cells, and samples are drawn cell by cell and take by take in turn.

A linear model uses a rotation's own sensor at the key poses, the common baseline of Wang & Neff 2013,
section 7.1 (key poses: section 5.1.1). Where a layout has no sensor of a rotation's name (an ankle sleeve),
it uses all sensors of the correspondence; where no key poses were recorded, or a rotation hardly moves in
them (the wrist), all samples: a line through noise would be no fair baseline.

How much each rotation of a model moves with each sensor, on average over what it was trained on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.model import CalibrationModel, RotationModel
from glovecal_models.errors import LayoutMismatch
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.regression.regressor import RuleRegressor
from glovecal_models.takes.camera_estimates import thinned
from glovecal_models.takes.take import Take

KEY_POSES = ("flat", "spread", "fist", "overbend")
LEAST_SHARE_OF_RANGE = 0.25
"""Key poses must span this share of a rotation's recorded range to carry its line."""
DEFAULT_SAMPLES = 2000
MOST_COUNTED = 2**22
"""Cells of a grid up to which the occupied ones are counted in a table, without sorting."""
INNER_SHARE = 0.25
"""Slopes are taken between this share of a sensor's trained range from below and from above."""
RANGE_IN_SD = 4.0
"""Readings spread over about four of their standard deviations."""


@dataclass(frozen=True)
class Samples:
    """N samples of one rotation."""

    inputs: np.ndarray
    """Regression inputs, shape (N, D), raw counts."""
    target: np.ndarray
    """Observed rotation, shape (N,), degrees."""
    take: np.ndarray
    """Index of the take each sample comes from, shape (N,)."""
    poses: np.ndarray
    """Pose name of each sample, "" for none, shape (N,)."""
    variance: np.ndarray | None = None
    """Stated variance of each target, shape (N,), degrees squared; 0 where its take states none; None where
    no take does."""

    def __len__(self) -> int:
        return len(self.target)

    def select(self, index: np.ndarray) -> Samples:
        variance = None if self.variance is None else self.variance[index]
        return Samples(self.inputs[index], self.target[index], self.take[index], self.poses[index], variance)


def require_layout(take: Take, layout: Layout) -> None:
    """Raise LayoutMismatch unless the take holds every sensor of the layout."""
    missing = [name for name in layout.sensors if name not in take.sensors]
    if missing:
        raise LayoutMismatch(
            f"take {take.name!r} has no sensor {missing[0]!r}, which layout {layout.name!r} needs; "
            f"its sensors are {', '.join(take.sensors)}"
        )


def gather_samples(takes: Sequence[Take], correspondence: Correspondence) -> Samples:
    """All frames of ``takes`` at which the rotation was measured (``sampled_rows``)."""
    inputs, targets, owners, poses, variances = [], [], [], [], []
    for index, take in enumerate(takes):
        target = take.reference_at_frames([correspondence.rotation])[:, 0]
        measured, variance = sampled_rows(take, correspondence.rotation, target)
        inputs.append(correspondence.input_columns(take.readings[measured], take.sensors))
        targets.append(target[measured])
        owners.append(np.full(len(measured), index))
        names = np.array(take.poses if take.poses is not None else [""] * len(target), dtype=object)
        poses.append(names[measured])
        variances.append(variance)
    return Samples(
        np.concatenate(inputs) if inputs else np.empty((0, len(correspondence.inputs))),
        np.concatenate(targets) if targets else np.empty(0),
        np.concatenate(owners) if owners else np.empty(0, dtype=int),
        np.concatenate(poses) if poses else np.empty(0, dtype=object),
        joined_variances(variances, [len(part) for part in targets]),
    )


def sampled_rows(take: Take, rotation: str, target: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """The frames whose ``target`` (N,) is a sample, and the variance of each, degrees squared.

    All that were measured; where deviations are stated only those that lie ``ALIKE_S`` apart: the errors of
    a camera last so long, and samples within count as one. None where the take states none.
    """
    measured = np.flatnonzero(np.isfinite(target))
    stated = take.reference_sd_at_frames([rotation])
    if stated is None or not np.isfinite(stated[measured, 0]).any():
        return measured, None
    measured = thinned(take.time_s, measured)
    return measured, stated[measured, 0] ** 2


def joined_variances(parts: Sequence[np.ndarray | None], counts: Sequence[int]) -> np.ndarray | None:
    """Of all takes after one another: 0 where a take states none, None where no take does."""
    if all(part is None for part in parts):
        return None
    return np.concatenate(
        [np.zeros(count) if part is None else part for part, count in zip(parts, counts, strict=True)]
    )


def linear_correspondence(correspondence: Correspondence) -> Correspondence:
    """The rotation read from its measuring sensor alone, when it has one."""
    if correspondence.simulated or correspondence.rotation not in correspondence.sensors:
        return correspondence
    return Correspondence(correspondence.rotation, "1S1R", (correspondence.rotation,))


def linear_samples(samples: Samples) -> Samples:
    """The samples at key poses, when these move the rotation enough; else all."""
    at_key_pose = np.isin(samples.poses.astype(str), KEY_POSES)
    if not at_key_pose.any():
        return samples
    chosen = samples.select(np.flatnonzero(at_key_pose))
    spans = np.ptp(chosen.target) >= LEAST_SHARE_OF_RANGE * np.ptp(samples.target)
    return chosen if spans and np.ptp(chosen.inputs, axis=0).min() > 0 else samples


def representative_index(samples: Samples, count: int = DEFAULT_SAMPLES, *, seed: int = 0) -> np.ndarray:
    """Indices of at most ``count`` samples, increasing; all of them when there are no more."""
    if len(samples) <= count:
        return np.arange(len(samples))
    cells = _cells(samples, count)
    order = np.random.default_rng(seed).permutation(len(samples))
    turn = _turn_within(cells[order])
    first = order[np.argsort(_short(turn), kind="stable")][:count]
    return np.sort(first)


def _cells(samples: Samples, count: int) -> np.ndarray:
    """A cell number for each sample, with the finest grid that has at most ``count`` occupied cells."""
    space = np.column_stack([samples.inputs, samples.target])
    low, high = space.min(axis=0), space.max(axis=0)
    unit = (space - low) / np.where(high > low, high - low, 1.0)
    cells, takes = samples.take, int(samples.take.max()) + 1
    each = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 128)
    # Of grids with no more cells than that, the finest comes next in any case.
    coarse = sum(takes * divisions ** space.shape[1] <= count for divisions in each)
    for divisions in each[max(coarse - 1, 0) :]:
        finer = _numbered(samples.take, np.floor(unit * divisions * (1 - 1e-12)), divisions)
        if finer.max() >= count:
            break
        cells = finer
    return cells


def _numbered(take: np.ndarray, grid: np.ndarray, divisions: int) -> np.ndarray:
    """A number for each row of (take, grid), in their order; by one integer key where it has room."""
    columns = grid.astype(np.int64)
    if (int(take.max()) + 1) * float(divisions) ** columns.shape[1] > 2**62:
        return np.unique(np.column_stack([take, columns]), axis=0, return_inverse=True)[1].ravel()
    key = take.astype(np.int64)
    for column in columns.T:
        key = key * divisions + column
    span = int(key.max()) + 1
    if span > MOST_COUNTED:
        return np.unique(key, return_inverse=True)[1].ravel()
    occupied = np.zeros(span, dtype=np.int32)
    occupied[key] = 1
    return (np.cumsum(occupied) - 1)[key]


def _short(numbers: np.ndarray) -> np.ndarray:
    """Numbers from 0 in two bytes where they have room: those are sorted by their digits."""
    return numbers.astype(np.uint16) if numbers.max(initial=0) < 2**16 else numbers


def _turn_within(cells: np.ndarray) -> np.ndarray:
    """For each sample, how many samples of its cell come before it."""
    by_cell = np.argsort(_short(cells), kind="stable")
    sorted_cells = cells[by_cell]
    starts = np.flatnonzero(np.r_[True, sorted_cells[1:] != sorted_cells[:-1]])
    lengths = np.diff(np.r_[starts, len(cells)])
    turn = np.empty(len(cells), dtype=int)
    turn[by_cell] = np.arange(len(cells)) - np.repeat(starts, lengths)
    return turn


@dataclass(frozen=True)
class SensorSensitivity:
    """L trained rotations, S sensors of the layout."""

    rotations: tuple[str, ...]
    sensors: tuple[str, ...]
    slope: np.ndarray
    """(L, S), degrees per reading; zero for a sensor that the rotation does not read."""
    low: np.ndarray
    """(S,) smallest trained reading; NaN for a sensor that no rotation reads by itself."""
    high: np.ndarray
    centre_deg: np.ndarray
    """(L,): the prediction in the middle of the trained readings."""
    spread_deg: np.ndarray
    """(L,): about one standard deviation of the rotation in training."""

    @property
    def range(self) -> np.ndarray:
        """(S,) trained range in readings, zero where unknown."""
        return np.nan_to_num(self.high - self.low)

    def measuring(self, sensor: str) -> str | None:
        """The rotation that moves most with a sensor, before all the one of its name; None if none does."""
        column = np.abs(self.slope[:, self.sensors.index(sensor)])
        if not column.any():
            return None
        return sensor if sensor in self.rotations else self.rotations[int(np.argmax(column))]


def sensor_sensitivity(model: CalibrationModel) -> SensorSensitivity:
    """From the model alone: the same for whatever is then predicted."""
    trained = [item for item in model.rotations if not isinstance(item.regressor, RuleRegressor)]
    sensors = model.layout.sensors
    low, high = trained_ranges(trained, sensors)
    found = [_of_rotation(item, sensors, low, high) for item in trained]
    return SensorSensitivity(
        tuple(item.rotation for item in trained),
        sensors,
        np.array([slope for slope, _, _ in found]).reshape(-1, len(sensors)),
        low,
        high,
        np.array([centre for _, centre, _ in found]),
        np.array([spread for _, _, spread in found]),
    )


def trained_ranges(trained: Sequence[RotationModel], sensors: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest reading (S,) of each sensor in training; NaN for one that nothing is read from."""
    ranges: Mapping[str, list[tuple[float, float]]] = {name: [] for name in sensors}
    for item in trained:
        for name, low, high in item.trained_ranges:
            if name in ranges:
                ranges[name].append((float(low), float(high)))
    low = [min((low for low, _ in ranges[name]), default=np.nan) for name in sensors]
    high = [max((high for _, high in ranges[name]), default=np.nan) for name in sensors]
    return np.array(low), np.array(high)


def _of_rotation(
    item: RotationModel, sensors: tuple[str, ...], low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, float, float]:
    """Slope (S,) in degrees per reading, prediction in the middle, standard deviation."""
    read = [sensors.index(name) for name in item.correspondence.sensors if name in sensors]
    read = [column for column in read if np.isfinite(low[column]) and high[column] > low[column]]
    middle = np.nan_to_num((low + high) / 2)
    points = np.repeat(middle[None], 1 + 2 * len(read), axis=0)
    for place, column in enumerate(read):
        inner = INNER_SHARE * (high[column] - low[column])
        points[1 + 2 * place, column] = low[column] + inner
        points[2 + 2 * place, column] = high[column] - inner
    angles = item.regressor.predict(item.correspondence.input_columns(points, sensors)).mean
    slope = np.zeros(len(sensors))
    for place, column in enumerate(read):
        apart = points[2 + 2 * place, column] - points[1 + 2 * place, column]
        slope[column] = (angles[2 + 2 * place] - angles[1 + 2 * place]) / apart
    spread = float(np.linalg.norm(slope * np.nan_to_num(high - low)) / RANGE_IN_SD)
    return slope, float(angles[0]), max(spread, 1e-6)
