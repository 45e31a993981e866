"""Many rotations' processes predicted together: few numpy calls in place of a dozen per rotation.

For plane + squared-exponential processes only, which is what training serves by default. Nodes are padded
to the largest of a group; padding has no weight. Distances are formed from differences, never expanded:
node weights are large and would magnify the rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from threading import local

import numpy as np

from glovecal_models.covariance.functions import SquaredExponentialArd
from glovecal_models.regression.regressor import ProcessRegressor, Regressor

DROPPED_VARIANCE = 1e-9
"""Degrees squared: what is left out of the variance, at most, for fewer columns of its root."""
ROUNDED_SHARE = 0.01
"""Of the noise variance: what the variance may lose to 7 digits. It costs half as much: what a frame needs is
mostly to read the roots of its model, which eight models do not have in the cache at once."""
LARGEST_REDUCED = 256
"""Larger variance roots stay whole: to reduce one takes the cube of its columns."""
GROUP_SIZES = (16, 64, 128, 256, 512)
"""Processes are grouped by the number of their nodes: padding costs more than another group's calls."""
SMALL_GROUP = 4
"""A group of fewer processes joins the next larger one."""


def is_fusible(regressor: Regressor) -> bool:
    """Whether ``FusedProcesses`` predicts this regressor."""
    return isinstance(regressor, ProcessRegressor) and isinstance(regressor.covariance, SquaredExponentialArd)


def grouped_by_nodes(processes: Sequence[tuple[int, ProcessRegressor]]) -> list[list[int]]:
    """Split (key, process) pairs into lists of keys with similar numbers of nodes, most inputs first."""
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
    inputs = {key: process.nodes.shape[1] for key, process in processes}
    groups = merged + ([waiting] if waiting else [])
    return [sorted(group, key=lambda key: -inputs[key]) for group in groups]


def _parts(processes: Sequence[ProcessRegressor], nodes_used: int) -> list[tuple[slice, np.ndarray]]:
    """For runs of inputs that the same R' processes have: rows of all inputs, and nodes (K, R', 1, M) along
    these K inputs, relevances taken in."""
    numbers = [process.nodes.shape[1] for process in processes]
    parts: list[tuple[slice, np.ndarray]] = []
    at, row = 0, 0
    while at < numbers[0]:
        count = sum(n > at for n in numbers)
        # as many inputs at once as the work array has room for
        end = min(numbers[count - 1], at + max(1, len(processes) // count))
        nodes = np.zeros((end - at, count, 1, nodes_used))
        for index, process in enumerate(processes[:count]):
            along = process.nodes[:, at:end] * _root_relevance(process)[at:end]
            nodes[:, index, 0, : len(along)] = along.T
        rows = slice(row, row + (end - at) * count)
        parts.append((rows, nodes))
        at, row = end, rows.stop
    return parts


class FusedProcesses:
    """Mean and variance of R processes whose inputs are linear in the glove's S sensors."""

    def __init__(self, processes: Sequence[ProcessRegressor], selections: Sequence[np.ndarray]) -> None:
        """``selections[i]`` (S, D_i): inputs of process i = readings @ selection. Most inputs come first."""
        self._count = len(processes)
        self._nodes_used = max(len(process.nodes) for process in processes)
        self._variance_nodes = max(_variance_nodes(process) for process in processes)
        numbers = [process.nodes.shape[1] for process in processes]
        # all first inputs, then the second ones of those processes that have one ...: nothing is padded
        each = [(index, at) for at in range(numbers[0]) for index, n in enumerate(numbers) if n > at]
        self._parts = _parts(processes, self._nodes_used)
        self._select = np.stack([selections[index][:, at] for index, at in each])
        self._shift = np.array([[processes[index].input_shift[at]] for index, at in each])
        scale = np.array([[processes[index].input_scale[at]] for index, at in each])
        self._to_nodes = np.array([[_root_relevance(processes[index])[at]] for index, at in each]) / scale
        self._slope = np.zeros((self._count, len(each)))
        for column, (index, at) in enumerate(each):
            self._slope[index, column] = processes[index].slope[at] / scale[column, 0]
        self._intercept = np.array([[process.intercept] for process in processes])
        self._log_signal = np.array([[[process.theta[0]]] for process in processes])
        self._signal = np.exp(self._log_signal[:, :, 0])
        self._weights = np.zeros((self._count, self._nodes_used, 1))
        for index, process in enumerate(processes):
            self._weights[index, : len(process.weights), 0] = process.weights
        self._roots = self._stacked(processes)
        self._widest = max(root.shape[2] for _, root in self._roots)

    def _stacked(self, processes: Sequence[ProcessRegressor]) -> list[tuple[slice, np.ndarray]]:
        """Variance roots of neighbouring processes with similar numbers of columns."""
        roots, stacked, start = list(map(_reduced_root, processes)), [], 0
        while start < len(roots):
            widths = [root.shape[1] for root in roots[start:]]
            end = next((n for n, width in enumerate(widths) if not _similar(width, widths[:n])), len(widths))
            stack = np.zeros((end, self._variance_nodes, max(widths[:end])))
            for index, root in enumerate(roots[start : start + end]):
                nodes = min(len(root), self._variance_nodes)
                stack[index, :nodes, : root.shape[1]] = root[:nodes]
            rows = slice(start, start + end)
            few_digits = all(map(_is_known_in_few_digits, processes[rows], roots[rows]))
            stacked.append((rows, stack.astype(np.float32) if few_digits else stack))
            start += end
        return stacked

    @property
    def floats_per_frame(self) -> int:
        """Size of the work arrays one frame needs."""
        return self._count * (2 * self._nodes_used + self._widest)

    def predict(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and variance, each (R, F), from readings transposed (S, F)."""
        frames = columns.shape[1]
        inputs = self._select @ columns
        inputs -= self._shift
        mean = self._slope @ inputs
        mean += self._intercept
        inputs *= self._to_nodes
        shape = (self._count, frames, self._nodes_used)
        size = self._count * frames * self._nodes_used
        work = _work(self.floats_per_frame * frames)
        kernel, away = work[:size].reshape(shape), work[size : 2 * size].reshape(shape)
        before = self._log_signal
        for rows, nodes in self._parts:
            inputs_each, count = len(nodes), nodes.shape[1]
            part = away[: inputs_each * count].reshape(inputs_each, count, frames, -1)
            np.subtract(nodes, inputs[rows].reshape(inputs_each, count, frames, 1), out=part)
            np.multiply(part, part, out=part)
            distance = part[0] if inputs_each == 1 else np.add.reduce(part, axis=0)
            np.subtract(before[:count], distance, out=kernel[:count])
            before = kernel
        np.exp(kernel, out=kernel)
        return self._from_kernel(kernel, mean, work[2 * size :])

    def _from_kernel(
        self, kernel: np.ndarray, mean: np.ndarray, work: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        variance, frames = np.empty_like(mean), kernel.shape[1]
        for rows, root in self._roots:
            to_nodes = kernel[rows, :, : self._variance_nodes].astype(root.dtype, copy=False)
            shape = (len(root), frames, root.shape[2])
            explained = work.view(root.dtype)[: len(root) * frames * root.shape[2]].reshape(shape)
            np.matmul(to_nodes, root, out=explained)
            np.einsum("rfk,rfk->rf", explained, explained, out=variance[rows], dtype=float)
        mean += np.matmul(kernel, self._weights)[:, :, 0]
        np.subtract(self._signal, variance, out=variance)
        np.maximum(variance, 0.0, out=variance)
        return mean, variance


_THREAD = local()


def _work(floats: int) -> np.ndarray:
    """This thread's work array, for all models: it stays in the processor's cache, and memory does not grow
    with the numbers of models and of frames that ever came together."""
    work: np.ndarray | None = getattr(_THREAD, "work", None)
    if work is None or len(work) < floats:
        work = _THREAD.work = np.empty(floats)
    return work[:floats]


def _root_relevance(process: ProcessRegressor) -> np.ndarray:
    """(D,): distances between inputs times it, squared and summed, are the exponent."""
    return np.sqrt(0.5) * np.exp(0.5 * process.theta[1:])


def _similar(width: int, before: Sequence[int]) -> bool:
    """Whether padding to one width costs less than another call."""
    return not before or 2 * width >= max(before) >= width / 2


def _reduced_root(process: ProcessRegressor) -> np.ndarray:
    """The variance root (M, r) with as few columns as nodes that lie close together allow.

    For every x the vector k(x, nodes) is K^1/2 z with |z|^2 <= signal variance s (the prior variance left
    given the nodes is not negative). So in the columns' principal axes, those of root' K root, the column of
    eigenvalue e explains at most s e, and all that are dropped together explain at most s times the largest.
    """
    root = process.variance_root
    if not 0 < root.shape[1] <= LARGEST_REDUCED:
        return root
    covariance = process.covariance(process.theta, process.nodes, process.nodes)
    values, axes = np.linalg.eigh(root.T @ covariance @ root)
    return root @ axes[:, values * np.exp(process.theta[0]) > DROPPED_VARIANCE]


def _is_known_in_few_digits(process: ProcessRegressor, root: np.ndarray) -> bool:
    """Whether the variance is right to ``ROUNDED_SHARE`` in single precision. A column explains its product
    with covariances of at most the signal variance; their rounding errors add up as those of random signs."""
    longest = np.linalg.norm(root, axis=0).max(initial=0.0)
    error = 2.0 * np.finfo(np.float32).eps * np.exp(1.5 * process.theta[0]) * longest
    return bool(error <= ROUNDED_SHARE * process.noise_variance)


def _variance_nodes(process: ProcessRegressor) -> int:
    """Nodes the variance needs: trailing rows of zeros are left out."""
    used = np.flatnonzero(process.variance_root.any(axis=1))
    return int(used[-1]) + 1 if len(used) else 0
