"""What is left between a model's prediction and the measurement, take by take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from math import comb

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.offline import OfflinePredictor
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.samples import require_layout
from glovecal_models.effects.base.effect import RepairEffect
from glovecal_models.errors import BadInput
from glovecal_models.takes.take import Take

MOST_PARTITIONS = 2000


@dataclass(frozen=True)
class TakeResiduals:
    """N frames and R rotations of one take; NaN where nothing was measured."""

    take: Take
    predicted: np.ndarray
    """(N, R), degrees."""
    sd: np.ndarray
    """Claimed standard deviation of a measurement, (N, R), degrees."""
    measured: np.ndarray
    """Reference at the frames, (N, R), degrees."""
    has_seen_wearing: bool | None = None
    """Whether the model knows the take's wearing; None: it does not say."""
    excluded: tuple[int, ...] = ()
    """For each rotation the measured frames that are not compared: its sensor failed. Empty: none."""

    @cached_property
    def error(self) -> np.ndarray:
        """Predicted minus measured, (N, R), degrees."""
        return self.predicted - self.measured

    @cached_property
    def reading_spread(self) -> np.ndarray:
        """Standard deviation of each sensor over the take, (S,), counts."""
        return self.take.readings.std(axis=0)


@dataclass(frozen=True)
class Residuals:
    """A model's residuals on takes, at least one of them measured."""

    rotations: tuple[str, ...]
    """Rotations of the model, the columns of every take."""
    takes: tuple[TakeResiduals, ...]

    @property
    def measured_rotations(self) -> tuple[str, ...]:
        """Rotations that some take measured."""
        some = np.any([np.isfinite(item.measured).any(axis=0) for item in self.takes], axis=0)
        return tuple(name for name, is_measured in zip(self.rotations, some, strict=True) if is_measured)

    @property
    def excluded(self) -> dict[str, int]:
        """Measured frames that are not compared, by rotation; only those that have some."""
        counts = dict.fromkeys(self.rotations, 0)
        for item in self.takes:
            for name, count in zip(self.rotations, item.excluded, strict=False):
                counts[name] += count
        return {name: count for name, count in counts.items() if count}

    def stated_deg(self, rotation: str) -> float | None:
        """RMS of the standard deviations that the reference states at the compared frames of one rotation,
        degrees; None where it states none."""
        column, parts = self.column(rotation), []
        for item in self.takes:
            stated = item.take.reference_sd_at_frames([rotation])
            if stated is not None:
                known = np.isfinite(stated[:, 0]) & np.isfinite(item.measured[:, column])
                parts.append(stated[known, 0])
        squares = np.concatenate([np.empty(0), *parts]) ** 2
        return float(np.sqrt(squares.mean())) if len(squares) else None

    def column(self, rotation: str) -> int:
        return self.rotations.index(rotation)

    def stacked(self, name: str) -> np.ndarray:
        """``error``, ``sd``, ``predicted`` or ``measured`` of all takes after one another, (sum of N, R)."""
        return np.concatenate([getattr(item, name) for item in self.takes])


def residuals(model: CalibrationModel, takes: Sequence[Take], *, offline: bool = False) -> Residuals:
    """Predict every frame of ``takes``, as a live glove's or ``offline``, with both directions of time.

    Raises LayoutMismatch, and BadInput when nothing was measured.
    """
    predictor = OfflinePredictor(model) if offline else GlovePredictor(model)
    names = predictor.rotations
    found = []
    for take in takes:
        require_layout(take, model.layout)
        given = take
        repairs = [
            (each, item.settings) for item in model.effects if isinstance(each := item.effect, RepairEffect)
        ]
        for effect, settings in repairs:
            if effect.by_prediction is None:
                take = effect.repaired([take], settings)[0]
        excluded = () if take is given else _excluded(given, take, names)
        index = [take.sensors.index(name) for name in model.layout.sensors]
        angles = predictor.predict_take(take.time_s, take.readings[:, index], take.context, take.wearing)
        for effect, settings in repairs:
            if effect.by_prediction is not None:
                take = effect.by_prediction.repaired_to(take, settings, names, angles.mean)
        found.append(
            TakeResiduals(
                take,
                angles.mean,
                _of_measurement(angles.sd, take, names),
                take.reference_at_frames(names),
                model.has_seen(take.wearing),
                excluded,
            )
        )
    result = Residuals(names, tuple(found))
    if not found or not result.measured_rotations:
        raise BadInput(
            "none of the takes measured a rotation of this model; compare needs r.ROTATION columns"
        )
    return result


def _of_measurement(sd: np.ndarray, take: Take, rotations: Sequence[str]) -> np.ndarray:
    """Claimed standard deviations (N, R) with what the reference states of itself."""
    stated = take.reference_sd_at_frames(rotations)
    return sd if stated is None else np.sqrt(sd**2 + np.nan_to_num(stated) ** 2)


def _excluded(given: Take, kept: Take, rotations: Sequence[str]) -> tuple[int, ...]:
    counts = [np.isfinite(take.reference_at_frames(rotations)).sum(axis=0) for take in (given, kept)]
    return tuple(int(count) for count in np.maximum(counts[0] - counts[1], 0))


def partitions(counts: tuple[int, ...]) -> int:
    """Distinct ways to split the takes into groups of these sizes, groups of equal size not told apart."""
    left, ways = sum(counts), 1
    for count in counts:
        ways *= comb(left, count)
        left -= count
    for size in set(counts):
        same = counts.count(size)
        for number in range(2, same + 1):
            ways //= number
    return ways


def permutations(
    owners: np.ndarray, counts: tuple[int, ...], generator: np.random.Generator
) -> list[np.ndarray]:
    """All other partitions when they are few, else many random ones, each at most once."""
    found: dict[bytes, np.ndarray] = {}
    if len(counts) == 2 and partitions(counts) <= MOST_PARTITIONS:
        first = np.array(list(combinations(range(len(owners)), counts[0])))
        drawn = np.ones((len(first), len(owners)), dtype=int)
        np.put_along_axis(drawn, first, 0, axis=1)
    else:
        drawn = np.array([generator.permutation(owners) for _ in range(2 * MOST_PARTITIONS)])
    for permuted, partition in zip(drawn, _partitions_of(drawn), strict=True):
        found[partition.tobytes()] = permuted
    found.pop(_partitions_of(owners[None])[0].tobytes(), None)
    return list(found.values())[:MOST_PARTITIONS]


def permuted_sessions(owners: np.ndarray, most: int, generator: np.random.Generator) -> list[np.ndarray]:
    """Up to ``most`` other ways to deal takes to wearings of the same sizes, each at most once."""
    counts = tuple(np.bincount(owners).tolist())
    found = permutations(owners, counts, generator)
    return [found[i] for i in generator.permutation(len(found))[:most]]


def _partitions_of(owners: np.ndarray) -> np.ndarray:
    """``partition_of`` each row of (D, T), whose numbers are below T."""
    numbers = np.arange(owners.shape[1])
    is_owner = owners[:, None, :] == numbers[None, :, None]
    first = np.where(is_owner.any(axis=2), is_owner.argmax(axis=2), owners.shape[1])
    rank = np.argsort(np.argsort(first, axis=1, kind="stable"), axis=1)
    return np.take_along_axis(rank, owners, axis=1)


def partition_of(owners: np.ndarray) -> tuple[int, ...]:
    """The same for partitions that differ only in the groups' names."""
    names: dict[int, int] = {}
    return tuple(names.setdefault(int(owner), len(names)) for owner in owners)
