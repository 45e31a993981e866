"""What a glove has shown so far, in free motion and with known angles, and what it is expected to read next.

In a step that was not recorded yet the measuring sensor follows its rotation and its neighbours; how it does
so is learned from the readings with known angles so far (a Bayesian regression of the sensor on the angle,
the inverse of the calibration), and until there are any it is taken to rise with the angle over its whole
range. Neighbours that move freely read what they read in free motion.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.layout import Correspondence
from glovecal_models.quick_check.held_poses import REPEAT_SD_DEG
from glovecal_models.sampling.protocol import Step
from glovecal_models.sampling.state import SamplingState
from glovecal_models.takes.take import Take

POSE_SD_DEG = REPEAT_SD_DEG
"""How far a pose is from its angles, the same in all of its frames."""
WIDGET_SD_DEG = 1.0
"""How well a widget holds its angle, the same in all frames of a step."""
ALIKE_FRAMES = 10
"""So many neighbouring frames tell as much as one sample: they read nearly the same, and err alike."""
FREE_ROWS, DENSE_ROWS, MOTION_ROWS = 64, 200, 12
"""Most readings taken from all free motion, from one take with a continuous reference, from one step."""
LEAST_FREE = 8
FEW_FREE = 200
"""Frames without reference; with fewer, those with one show better where a glove is used."""


@dataclass(frozen=True)
class KnownBlock:
    """Readings of one step, or of a stretch of a take, that share an error."""

    readings: np.ndarray
    """Shape (m, S), counts."""
    angles: Mapping[str, np.ndarray]
    """Degrees by rotation, shape (m,) each, NaN where not measured."""
    samples: float
    """How many independent samples the rows stand for."""
    shared_sd_deg: float
    """Standard deviation of the error that all of them have in common."""


@dataclass(frozen=True)
class KnownReadings:
    sensors: tuple[str, ...]
    low: np.ndarray
    """Ends of each sensor's active range, shape (S,), counts."""
    high: np.ndarray
    free: np.ndarray
    """Readings that people really give, shape (N, S): where the variance has to be small."""
    blocks: tuple[KnownBlock, ...] = field(default=())

    def __post_init__(self) -> None:
        if len(self.free) < LEAST_FREE:
            raise BadInput(
                f"{len(self.free)} readings of free motion; at least {LEAST_FREE} are needed to know where "
                "the model will be used: move the hand freely for some seconds first"
            )


def shared_sd_deg(step: Step) -> float:
    return POSE_SD_DEG if step.motion == "hold" else WIDGET_SD_DEG


def known_from_state(state: SamplingState) -> KnownReadings:
    """From the readings that attempts have kept. Raises BadInput before anything moved freely."""
    free, blocks = [np.empty((0, len(state.sensors)))], []
    for name, attempt in state.finished().items():
        step, kept = state.protocol.step(name), np.array(attempt.kept, float)
        if not len(kept):
            continue
        if step.kind == "range":
            free.append(kept)
        elif step.angles:
            angles = {rotation: np.full(len(kept), deg) for rotation, deg in step.angles.items()}
            blocks.append(KnownBlock(kept, angles, attempt.frames / ALIKE_FRAMES, shared_sd_deg(step)))
    seen = np.concatenate(free)
    low, high = (seen.min(axis=0), seen.max(axis=0)) if len(seen) else (np.empty(0), np.empty(0))
    return KnownReadings(state.sensors, low, high, seen, tuple(blocks))


def known_from_takes(
    takes: Sequence[Take], sensors: tuple[str, ...], more_free: Iterable[Take] = ()
) -> KnownReadings:
    """From stored takes: a stretch with one constant angle is a step, any other reference is dense.

    Free motion are the frames without reference, of ``takes`` and of ``more_free``; where there are few of
    them, all frames. Raises BadInput for takes with hardly any frames.
    """
    every = [_columns(take, sensors) for take in (*takes, *more_free)]
    frames = np.concatenate([np.empty((0, len(sensors))), *every])
    unlabelled = np.concatenate([np.zeros(0, bool), *(_unlabelled(take) for take in (*takes, *more_free))])
    blocks = tuple(block for take in takes for block in _blocks(take, sensors))
    free = spread_rows(frames[unlabelled] if unlabelled.sum() >= FEW_FREE else frames, FREE_ROWS)
    nothing = np.empty(0)
    low, high = np.quantile(frames, [0.005, 0.995], axis=0) if len(frames) else (nothing, nothing)
    return KnownReadings(sensors, low, high, free, blocks)


def _unlabelled(take: Take) -> np.ndarray:
    """Frames (N,) at which no angle is known."""
    if not take.rotations:
        return np.ones(len(take.time_s), bool)
    return np.asarray(np.isnan(take.reference_at_frames(take.rotations)).all(axis=1))


def spread_rows(readings: np.ndarray, most: int) -> np.ndarray:
    """At most ``most`` rows, evenly through time."""
    if len(readings) <= most:
        return readings
    return readings[np.linspace(0, len(readings) - 1, most).round().astype(int)]


def _columns(take: Take, sensors: tuple[str, ...]) -> np.ndarray:
    return np.asarray(take.readings, float)[:, [take.sensors.index(name) for name in sensors]]


def _blocks(take: Take, sensors: tuple[str, ...]) -> list[KnownBlock]:
    if not take.rotations:
        return []
    readings, reference = _columns(take, sensors), take.reference_at_frames(take.rotations)
    rows = np.flatnonzero(np.isfinite(reference).any(axis=1))
    if not len(rows):
        return []
    value = np.where(np.isfinite(reference[rows]), reference[rows], np.inf)
    changes = (value[1:] != value[:-1]).any(axis=1) | (np.diff(rows) > 1)
    runs = np.split(rows, np.flatnonzero(changes) + 1)
    if len(runs) * ALIKE_FRAMES > len(rows):
        return [_dense(readings, reference, rows, take.rotations)]
    return [_step(readings, reference, run, take.rotations) for run in runs]


def _dense(readings: np.ndarray, reference: np.ndarray, rows: np.ndarray, names: Sequence[str]) -> KnownBlock:
    chosen = rows[np.linspace(0, len(rows) - 1, min(len(rows), DENSE_ROWS)).round().astype(int)]
    return KnownBlock(readings[chosen], _angles(reference[chosen], names), len(rows) / ALIKE_FRAMES, 0.0)


def _step(readings: np.ndarray, reference: np.ndarray, run: np.ndarray, names: Sequence[str]) -> KnownBlock:
    """A widget holds one rotation, a pose several: then the hand is still and its mean reading counts."""
    known, samples = int(np.isfinite(reference[run[0]]).sum()), len(run) / ALIKE_FRAMES
    if known > 1:
        mean = readings[run].mean(axis=0)[None]
        return KnownBlock(mean, _angles(reference[run[:1]], names), samples, POSE_SD_DEG)
    chosen = run[np.linspace(0, len(run) - 1, min(len(run), MOTION_ROWS)).round().astype(int)]
    return KnownBlock(readings[chosen], _angles(reference[chosen], names), samples, WIDGET_SD_DEG)


def _angles(reference: np.ndarray, names: Sequence[str]) -> dict[str, np.ndarray]:
    return {
        name: reference[:, column]
        for column, name in enumerate(names)
        if np.isfinite(reference[:, column]).any()
    }


RISE, RISE_SD, PULL_SD, LEVEL_SD, SCATTER = 1.0, 0.7, 0.6, 0.3, 0.05
"""Of a sensor before anything is known: its rise with the angle, what neighbours do, where its middle is,
how far from it single readings are; all in ranges of the sensor."""
FURTHEST = 0.7
"""From the middle of the range; a half is its end."""


class ExpectedReadings:
    """Learns every measuring sensor from ``known`` once."""

    def __init__(self, known: KnownReadings, correspondences: Sequence[Correspondence]) -> None:
        self._known = known
        self._middle, self._span = (known.low + known.high) / 2, np.maximum(known.high - known.low, 1e-9)
        self._free = (spread_rows(known.free, MOTION_ROWS) - self._middle) / self._span
        self._by_rotation = {item.rotation: item for item in correspondences if item.simulated is None}
        self._learned = {
            name: self._learn(item) for name, item in self._by_rotation.items() if name in known.sensors
        }

    def of(self, step: Step, correspondence: Correspondence) -> np.ndarray:
        """Inputs (m, D), counts, from which ``step`` would give samples of the rotation."""
        if step.motion == "hold":
            unit = np.median(self._free, axis=0)[None]
            for rotation in sorted(step.angles, key=lambda name: len(self._neighbours(name))):
                self._set_own(unit, rotation, step.angles)
        else:
            unit = self._free.copy()
            self._set_own(unit, correspondence.rotation, step.angles)
        readings = self._middle + self._span * unit
        return correspondence.input_columns(readings, self._known.sensors)

    def _set_own(self, unit: np.ndarray, rotation: str, angles: Mapping[str, float]) -> None:
        """The measuring sensor's column in rows ``unit`` (m, S), from angle and neighbours."""
        if rotation not in self._learned:
            return
        weights = self._learned[rotation]
        features = _features(
            _share(rotation, np.array([angles[rotation]])), unit[:, self._neighbours(rotation)]
        )
        unit[:, self._known.sensors.index(rotation)] = np.clip(features @ weights, -FURTHEST, FURTHEST)

    def _neighbours(self, rotation: str) -> list[int]:
        item = self._by_rotation.get(rotation)
        others = () if item is None else item.sensors
        return [self._known.sensors.index(name) for name in others if name != rotation]

    def _learn(self, item: Correspondence) -> np.ndarray:
        """Weights of ``_features``: the posterior mean of the regression."""
        rotation, neighbours = item.rotation, self._neighbours(item.rotation)
        own = self._known.sensors.index(rotation)
        prior = np.array([0.0, RISE, *[0.0] * (2 * len(neighbours))])
        precision = np.array([LEVEL_SD, RISE_SD, *[PULL_SD] * (2 * len(neighbours))]) ** -2.0
        matrix, right = np.diag(precision), precision * prior
        for block in self._known.blocks:
            if rotation not in block.angles:
                continue
            angle = block.angles[rotation]
            measured = np.isfinite(angle)
            unit = (block.readings[measured] - self._middle) / self._span
            features = _features(_share(rotation, angle[measured]), unit[:, neighbours])
            matrix += features.T @ features / SCATTER**2
            right += features.T @ unit[:, own] / SCATTER**2
        return np.linalg.solve(matrix, right)


def _share(rotation: str, angle_deg: np.ndarray) -> np.ndarray:
    """Angle from the middle of the rotation's range, in ranges."""
    low, high = ACTIVE_RANGE_DEG.get(rotation, (0.0, 90.0))
    return (angle_deg - (low + high) / 2) / (high - low)


def _features(share: np.ndarray, neighbours: np.ndarray) -> np.ndarray:
    """[1, angle, neighbours, their squares], shape (m, 2 + 2 K)."""
    rows = max(len(share), len(neighbours))
    columns = [np.ones(rows), np.broadcast_to(share, rows)]
    return np.column_stack([*columns, neighbours, neighbours**2])
