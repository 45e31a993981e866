"""Live prediction of a whole glove: all rotations of a calibration model from raw readings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.correction_parts import VarianceInflation
from glovecal_models.calibration.effect_correction import EffectCorrection, usable_correction
from glovecal_models.calibration.fused_processes import FusedProcesses, grouped_by_nodes, is_fusible
from glovecal_models.calibration.model import CalibrationModel, RotationModel
from glovecal_models.errors import BadInput
from glovecal_models.regression.regressor import ProcessRegressor, RuleRegressor

EXTRAPOLATING, TOO_UNCERTAIN, BY_RULE, FAULTY_SENSOR = 1, 2, 4, 8
RANGE_MARGIN = 0.05
"""An input this share of its training range outside that range is extrapolating."""
LEAST_VARIANCE = 1e-4
"""Degrees squared: no reference repeats itself better."""
FLOATS_AT_ONCE = 200_000
"""Frames are predicted in blocks with work arrays of about this size: they stay in the processor's cache."""
FRAMES_AT_ONCE = (16, 256)
"""At least, so that a large model is not read from memory for each frame, and at most."""


@dataclass(frozen=True)
class GloveAngles:
    """Rotations of N frames, in the order of ``GlovePredictor.rotations``."""

    mean: np.ndarray
    """Degrees, shape (N, R)."""
    sd: np.ndarray
    """Standard deviation of a measurement of the rotation: its own uncertainty plus noise, shape (N, R)."""
    flags: np.ndarray
    """uint8, shape (N, R): 1 extrapolating, 2 too uncertain to use, 4 by rule, 8 faulty sensor."""

    def row(self, number: int) -> GloveAngles:
        """Of one frame, shape (1, R); negative numbers count from the end."""
        return GloveAngles(self.mean[number][None], self.sd[number][None], self.flags[number][None])


class GlovePredictor:
    """Predicts one frame or many with a calibration model.

    ``predict`` is the regressors alone; ``predict_take`` and ``with_effects`` add the model's effects.
    """

    def __init__(self, model: CalibrationModel) -> None:
        self.rotations = model.rotation_names
        self.sensors = model.layout.sensors
        measured = [
            index
            for index, item in enumerate(model.rotations)
            if not isinstance(item.regressor, RuleRegressor)
        ]
        self._groups, self._others = _split(model, measured)
        self.rules = _ordered_rules(model)
        """(row, rows of its sources, weights) of every rule, sources before those that need them."""
        self._model = model
        self.has_effects = not model.correction().is_empty
        items = model.rotations
        self._noise = np.array([[item.regressor.noise_variance] for item in items])
        limits = [[item.uncertain_above_deg**2] for item in items]
        self._largest_variance = np.array(limits)
        self._range = _Range([(index, items[index]) for index in measured], model)
        frame = sum(group.floats_per_frame for _, group in self._groups)
        self._block = int(np.clip(FLOATS_AT_ONCE // max(frame, 1), *FRAMES_AT_ONCE))

    def predict(self, readings: np.ndarray) -> GloveAngles:
        """Angles from ``readings`` (N, S), raw counts in the layout's sensor order.

        Raises BadInput on a wrong shape and on readings that are not finite.
        """
        readings = np.asarray(readings, dtype=float)
        if readings.ndim != 2 or readings.shape[1] != len(self.sensors):
            raise BadInput(f"readings have shape {readings.shape}, expected (N, {len(self.sensors)})")
        if not np.isfinite(readings).all():
            frame, sensor = np.argwhere(~np.isfinite(readings))[0]
            value = readings[frame, sensor]
            raise BadInput(f"sensor {self.sensors[sensor]} reads {value} in frame {frame}; leave it out")
        count = len(readings)
        if count == 0:
            nothing = np.empty((0, len(self.rotations)))
            return GloveAngles(nothing, nothing, nothing.astype(np.uint8))
        if count <= self._block:
            return self._predict_block(readings)
        blocks = [
            self._predict_block(readings[start : start + self._block])
            for start in range(0, count, self._block)
        ]
        return GloveAngles(
            np.concatenate([block.mean for block in blocks]),
            np.concatenate([block.sd for block in blocks]),
            np.concatenate([block.flags for block in blocks]),
        )

    def predict_take(
        self, time_s: np.ndarray, readings: np.ndarray, context: Mapping[str, np.ndarray], wearing: str
    ) -> GloveAngles:
        """Angles of a whole take (N frames), effects with a memory started at its first frame.

        ``context`` holds columns (N,), NaN where unknown. Raises BadInput as ``predict`` does.
        """
        angles = self.predict(readings)
        if not self.has_effects or not len(angles.mean):
            return angles
        effects = self._model.correction()
        correction = effects.of_take(time_s, angles.mean, readings, context, wearing)
        return self.corrected(angles, correction.degrees, inflation=correction.inflation)

    def corrected(
        self,
        angles: GloveAngles,
        correction: np.ndarray,
        uncertain: np.ndarray | None = None,
        inflation: VarianceInflation | None = None,
    ) -> GloveAngles:
        """``angles`` with the effects' ``correction`` (N, R) added; rules follow the rotations they read.

        Where the correction is unusable the rotation stays as it was. There, and where ``uncertain`` (N, R)
        says so, it is flagged too uncertain. ``inflation`` is of all N frames.
        """
        if inflation is not None:
            angles = self._inflated(angles, inflation)
        usable = usable_correction(correction)
        mean, flags = angles.mean + np.where(usable, correction, 0.0), angles.flags
        bad = ~usable if uncertain is None else ~usable | uncertain
        any_bad = bool(bad.any())
        if any_bad:
            flags = np.where(bad, flags | TOO_UNCERTAIN, flags).astype(np.uint8)
        for row, sources, weights in self.rules:
            mean[:, row] = mean[:, sources] @ weights
            if any_bad:
                flags[:, row] |= np.bitwise_or.reduce(flags[:, sources] & TOO_UNCERTAIN, axis=1)
        return GloveAngles(mean, angles.sd, flags)

    def _inflated(self, angles: GloveAngles, inflation: VarianceInflation) -> GloveAngles:
        """With the variance and the flags that the effects' inflation asks for."""
        variance = np.maximum(angles.sd**2 + inflation.variance, LEAST_VARIANCE)
        flags = np.where(inflation.is_faulty, angles.flags | FAULTY_SENSOR, angles.flags).astype(np.uint8)
        is_old = inflation.is_faulty & (inflation.variance > self._largest_variance.T)
        np.bitwise_or(flags, TOO_UNCERTAIN, out=flags, where=is_old)
        for row, sources, weights in self.rules:
            variance[:, row] = variance[:, sources] @ (weights * weights)
            flags[:, row] |= np.bitwise_or.reduce(flags[:, sources], axis=1)
        return GloveAngles(angles.mean, np.sqrt(variance), flags)

    def stream(self) -> EffectCorrection:
        """The effects' state for one glove's frames, to be used with ``corrected``."""
        return self._model.correction()

    def _predict_block(self, readings: np.ndarray) -> GloveAngles:
        columns = readings.T
        mean = np.empty((len(self.rotations), len(readings)))
        variance = np.zeros_like(mean)
        for rows, group in self._groups:
            mean[rows], variance[rows] = group.predict(columns)
        for row, predict in self._others:
            mean[row], variance[row] = predict(readings)
        flags = self._range.flags(columns, len(mean))
        np.bitwise_or(flags, TOO_UNCERTAIN, out=flags, where=variance > self._largest_variance)
        variance += self._noise
        for row, sources, weights in self.rules:
            mean[row] = weights @ mean[sources]
            variance[row] = (weights * weights) @ variance[sources]
            flags[row] = np.bitwise_or.reduce(flags[sources], axis=0) | BY_RULE
        return GloveAngles(mean.T, np.sqrt(variance).T, flags.T)


class _Range:
    """Which inputs are outside what was trained on."""

    def __init__(self, items: list[tuple[int, RotationModel]], model: CalibrationModel) -> None:
        selections = [_selection(item, model) for _, item in items]
        sensors = len(model.layout.sensors)
        self._select = np.concatenate([s.T for s in selections]) if items else np.zeros((0, sensors))
        low = np.concatenate([item.input_low for _, item in items]) if items else np.empty(0)
        high = np.concatenate([item.input_high for _, item in items]) if items else np.empty(0)
        margin = RANGE_MARGIN * (high - low)
        self._low, self._high = (low - margin)[:, None], (high + margin)[:, None]
        self._rows = np.array([index for index, _ in items], dtype=np.intp)
        self._starts = np.cumsum([0, *[s.shape[1] for s in selections]])[:-1]

    def flags(self, columns: np.ndarray, rotations: int) -> np.ndarray:
        """uint8 (R, N): EXTRAPOLATING or 0."""
        flags = np.zeros((rotations, columns.shape[1]), dtype=np.uint8)
        if not len(self._rows):
            return flags
        inputs = self._select @ columns
        outside = (inputs < self._low) | (inputs > self._high)
        flags[self._rows] = np.logical_or.reduceat(outside, self._starts, axis=0)
        return flags


_Predict = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def _split(
    model: CalibrationModel, measured: list[int]
) -> tuple[list[tuple[np.ndarray, FusedProcesses]], list[tuple[int, _Predict]]]:
    """Fused groups with their rows, and the rows that are predicted one by one."""
    processes: list[tuple[int, ProcessRegressor]] = []
    others: list[tuple[int, _Predict]] = []
    for index in measured:
        regressor = model.rotations[index].regressor
        if isinstance(regressor, ProcessRegressor) and is_fusible(regressor):
            processes.append((index, regressor))
        else:
            others.append((index, _one_by_one(model.rotations[index], model)))
    by_index = dict(processes)
    groups = []
    for rows in grouped_by_nodes(processes):
        selections = [_selection(model.rotations[row], model) for row in rows]
        groups.append((np.array(rows), FusedProcesses([by_index[row] for row in rows], selections)))
    return groups, others


def _one_by_one(item: RotationModel, model: CalibrationModel) -> _Predict:
    correspondence, regressor, sensors = item.correspondence, item.regressor, model.layout.sensors

    def predict(readings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        prediction = regressor.predict(correspondence.input_columns(readings, sensors))
        return prediction.mean, prediction.variance

    return predict


def _selection(item: RotationModel, model: CalibrationModel) -> np.ndarray:
    """Matrix (S, D) with inputs = readings @ matrix: every correspondence is linear in the sensors."""
    return item.correspondence.input_columns(np.eye(len(model.layout.sensors)), model.layout.sensors)


def _ordered_rules(model: CalibrationModel) -> list[tuple[int, np.ndarray, np.ndarray]]:
    """(row, rows of its sources, weights) of every rule, sources before those that need them."""
    names = list(model.rotation_names)
    waiting = {
        index: item.regressor
        for index, item in enumerate(model.rotations)
        if isinstance(item.regressor, RuleRegressor)
    }
    ordered: list[tuple[int, np.ndarray, np.ndarray]] = []
    while waiting:
        ready = [
            index
            for index, rule in waiting.items()
            if not any(names.index(name) in waiting for name in rule.rotations)
        ]
        if not ready:
            stuck = ", ".join(names[index] for index in waiting)
            raise BadInput(f"the rules for {stuck} depend on each other in a circle")
        for index in ready:
            rule = waiting.pop(index)
            sources = np.array([names.index(name) for name in rule.rotations], dtype=np.intp)
            ordered.append((index, sources, np.asarray(rule.weights, dtype=float)))
    return ordered
