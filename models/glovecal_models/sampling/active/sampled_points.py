"""Samples of one rotation from what a glove has shown: inputs, targets, and how their errors go together."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from glovecal_models.layout import Correspondence
from glovecal_models.sampling.active.assumed_process import AssumedProcess
from glovecal_models.sampling.active.known_readings import KnownBlock


@dataclass(frozen=True)
class SampledPoints:
    """Of one step."""

    points: np.ndarray
    """Inputs in the process' units, shape (m, D + 1)."""
    errors: np.ndarray
    """Covariance of the errors, shape (m, m), degrees squared."""
    target: np.ndarray = field(default_factory=lambda: np.empty(0))
    """Degrees, shape (m,); empty for a step that was not recorded yet."""


def step_errors(rows: int, samples: float, noise_sd_deg: float, shared_sd_deg: float) -> np.ndarray:
    """Error covariance (m, m) of ``rows`` that stand for ``samples`` and have one error in common."""
    own = noise_sd_deg**2 * rows / max(samples, 1.0)
    return own * np.eye(rows) + shared_sd_deg**2


def sampled_points(
    block: KnownBlock, item: Correspondence, process: AssumedProcess, sensors: tuple[str, ...]
) -> SampledPoints:
    """What ``block`` knows of the rotation; no points where it was not measured."""
    angle = block.angles.get(item.rotation, np.full(len(block.readings), np.nan))
    rows = np.isfinite(angle)
    points = process.unit(item.input_columns(block.readings[rows], sensors))
    samples = block.samples * rows.mean()
    errors = step_errors(len(points), samples, process.noise_sd_deg, block.shared_sd_deg)
    return SampledPoints(points, errors, angle[rows])
