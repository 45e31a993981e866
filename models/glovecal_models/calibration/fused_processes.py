"""Many rotations' processes predicted together: few numpy calls in place of a dozen per rotation.

For plane + squared-exponential processes only, which is what training serves by default. Nodes are padded
to the largest of a group; padding has no weight. Distances are formed from differences, never expanded:
node weights are large and would magnify the rounding.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.covariance.squared_exponential_ard import SquaredExponentialArd
from glovecal_models.regression.process_regressor import ProcessRegressor
from glovecal_models.regression.regressor import Regressor

GROUP_SIZES = (16, 64, 128, 256, 512)
"""Processes are grouped by the number of their nodes: padding costs more than another group's calls."""
SMALL_GROUP = 4
"""A group of fewer processes joins the next larger one."""


def is_fusible(regressor: Regressor) -> bool:
    """Whether ``FusedProcesses`` predicts this regressor."""
    return isinstance(regressor, ProcessRegressor) and isinstance(regressor.covariance, SquaredExponentialArd)


def grouped_by_nodes(processes: Sequence[tuple[int, ProcessRegressor]]) -> list[list[int]]:
    """Split (key, process) pairs into lists of keys with similar numbers of nodes."""
    groups: list[list[int]] = [[] for _ in (*GROUP_SIZES, None)]
    for key, process in processes:
        groups[int(np.searchsorted(GROUP_SIZES, _variance_nodes(process)))].append(key)
    merged: list[list[int]] = []
    waiting: list[int] = []
    for size, group in zip((*GROUP_SIZES, np.inf), groups, strict=True):
        waiting = waiting + group
        if waiting and (len(waiting) >= SMALL_GROUP or size > GROUP_SIZES[2]):
            merged.append(waiting)
            waiting = []
    return merged + ([waiting] if waiting else [])


class FusedProcesses:
    """Mean and variance of R processes whose inputs are linear in the glove's S sensors.

    Keeps work arrays between calls: not safe to share between threads.
    """

    def __init__(self, processes: Sequence[ProcessRegressor], selections: Sequence[np.ndarray]) -> None:
        """``selections[i]`` (S, D_i): inputs of process i = readings @ selection."""
        self.count = len(processes)
        self._dimensions = max(len(process.input_shift) for process in processes)
        self._nodes_used = max(len(process.nodes) for process in processes)
        self._variance_nodes = max(_variance_nodes(process) for process in processes)
        rank = max(process.variance_root.shape[1] for process in processes)
        r, d, m = self.count, self._dimensions, self._nodes_used
        sensors = selections[0].shape[0]
        self._select = np.zeros((d, r, sensors))
        self._shift, self._scale = np.zeros((d, r, 1)), np.ones((d, r, 1))
        self._root_relevance = np.zeros((d, r, 1))
        self._slope, self._intercept = np.zeros((d, r, 1)), np.zeros((r, 1))
        self._nodes = np.zeros((d, r, 1, m))
        self._log_signal = np.empty((r, 1, 1))
        self._weights = np.zeros((r, m, 1))
        self._root = np.zeros((r, self._variance_nodes, rank))
        for index, (process, selection) in enumerate(zip(processes, selections, strict=True)):
            self._put(index, process, selection)
        self._signal = np.exp(self._log_signal[:, :, 0])
        self._mean_apart = self._variance_nodes < m
        if self._mean_apart:
            # hundreds of nodes: a frame costs what reading the root costs; 7 digits do for a variance
            self._root = self._root.astype(np.float32)
        else:
            self._root = np.ascontiguousarray(np.concatenate([self._root, self._weights], axis=2))
        self._select = self._select.reshape(d * r, sensors)
        self._work: dict[int, tuple[np.ndarray, ...]] = {}

    def _put(self, index: int, process: ProcessRegressor, selection: np.ndarray) -> None:
        d, m = process.nodes.shape[1], len(process.nodes)
        root_relevance = np.sqrt(0.5) * np.exp(0.5 * process.theta[1:])
        self._select[:d, index] = selection.T
        self._shift[:d, index, 0], self._scale[:d, index, 0] = process.input_shift, process.input_scale
        self._root_relevance[:d, index, 0] = root_relevance
        self._slope[:d, index, 0], self._intercept[index, 0] = process.slope, process.intercept
        self._nodes[:d, index, 0, :m] = (process.nodes * root_relevance).T
        self._log_signal[index] = process.theta[0]
        self._weights[index, :m, 0] = process.weights
        v, r = min(len(process.variance_root), self._variance_nodes), process.variance_root.shape[1]
        self._root[index, :v, :r] = process.variance_root[:v]

    @property
    def floats_per_frame(self) -> int:
        """Size of the work arrays one frame needs."""
        return (self._dimensions + 1) * self.count * self._nodes_used

    def predict(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and variance, each (R, F), from readings transposed (S, F). Overwritten by the next call."""
        frames = columns.shape[1]
        work = self._work.get(frames) or self._buffers(frames)
        inputs, away, kernel, explained, mean, variance = work
        np.matmul(self._select, columns, out=inputs.reshape(-1, frames))
        np.subtract(inputs, self._shift, out=inputs)
        np.divide(inputs, self._scale, out=inputs)
        np.einsum("drf,drz->rf", inputs, self._slope, out=mean)
        mean += self._intercept
        np.multiply(inputs, self._root_relevance, out=inputs)
        np.subtract(self._nodes, inputs[..., None], out=away)
        np.multiply(away, away, out=away)
        np.add.reduce(away, axis=0, out=kernel)
        np.subtract(self._log_signal, kernel, out=kernel)
        np.exp(kernel, out=kernel)
        to_nodes = kernel[:, :, : self._variance_nodes].astype(self._root.dtype, copy=False)
        np.matmul(to_nodes, self._root, out=explained)
        if self._mean_apart:
            mean += np.matmul(kernel, self._weights)[:, :, 0]
            part = explained
        else:
            mean += explained[:, :, -1]
            part = explained[:, :, :-1]
        np.einsum("rfk,rfk->rf", part, part, out=variance, dtype=float)
        np.subtract(self._signal, variance, out=variance)
        np.maximum(variance, 0.0, out=variance)
        return mean, variance

    def _buffers(self, frames: int) -> tuple[np.ndarray, ...]:
        r, d, m = self.count, self._dimensions, self._nodes_used
        made = (
            np.empty((d, r, frames)),
            np.empty((d, r, frames, m)),
            np.empty((r, frames, m)),
            np.empty((r, frames, self._root.shape[2]), self._root.dtype),
            np.empty((r, frames)),
            np.empty((r, frames)),
        )
        if frames <= 16:
            self._work[frames] = made
        return made


def _variance_nodes(process: ProcessRegressor) -> int:
    """Nodes the variance needs: trailing rows of zeros are left out."""
    used = np.flatnonzero(process.variance_root.any(axis=1))
    return int(used[-1]) + 1 if len(used) else 0
