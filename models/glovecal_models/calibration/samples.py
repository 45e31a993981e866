"""Samples of one rotation: the paper's tuples (readings, observed rotation), gathered from takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import LayoutMismatch
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.takes.take import Take


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

    def __len__(self) -> int:
        return len(self.target)

    def select(self, index: np.ndarray) -> Samples:
        return Samples(self.inputs[index], self.target[index], self.take[index], self.poses[index])


def require_layout(take: Take, layout: Layout) -> None:
    """Raise LayoutMismatch unless the take holds every sensor of the layout."""
    missing = [name for name in layout.sensors if name not in take.sensors]
    if missing:
        raise LayoutMismatch(
            f"take {take.name!r} has no sensor {missing[0]!r}, which layout {layout.name!r} needs; "
            f"its sensors are {', '.join(take.sensors)}"
        )


def gather_samples(takes: Sequence[Take], correspondence: Correspondence) -> Samples:
    """All frames of ``takes`` at which the rotation was measured."""
    inputs, targets, owners, poses = [], [], [], []
    for index, take in enumerate(takes):
        target = take.reference_at_frames([correspondence.rotation])[:, 0]
        measured = np.isfinite(target)
        inputs.append(correspondence.input_columns(take.readings[measured], take.sensors))
        targets.append(target[measured])
        owners.append(np.full(int(measured.sum()), index))
        names = np.array(take.poses if take.poses is not None else [""] * len(measured), dtype=object)
        poses.append(names[measured])
    return Samples(
        np.concatenate(inputs) if inputs else np.empty((0, len(correspondence.inputs))),
        np.concatenate(targets) if targets else np.empty(0),
        np.concatenate(owners) if owners else np.empty(0, dtype=int),
        np.concatenate(poses) if poses else np.empty(0, dtype=object),
    )
