"""References that name a pose and measure no angle: 1 for a fist, 0 for a flat hand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.takes.take import Take

LABELS = (0.0, 1.0)
WHY_NOT_JUDGEABLE = "the reference only names poses (0 or 1) and measures no angle"

UNITS = "The reference only names poses: errors are shares of the step from 0 to 1, not degrees."


def are_pose_labels(takes: Sequence[Take]) -> bool:
    """Whether all reference values of all takes are 0 or 1, both occur, and each lasts."""
    values = [take.reference[np.isfinite(take.reference)] for take in takes if take.rotations]
    return bool(values) and set(np.unique(np.concatenate(values)).tolist()) == set(LABELS)


def labels_at_frames(take: Take) -> tuple[str, ...] | None:
    """A pose name for each frame: the take's own, else its reference where that only names poses."""
    if take.poses is not None:
        return take.poses
    if not take.rotations:
        return None
    measured = take.reference[np.isfinite(take.reference)]
    if not len(measured) or not np.isin(measured, LABELS).all():
        return None
    levels = take.reference_at_frames(take.rotations)
    return tuple(_label(take.rotations, row) for row in levels)


def _label(rotations: Sequence[str], values: np.ndarray) -> str:
    if not np.isfinite(values).all():
        return ""
    if len(values) > 1 and len(set(values.tolist())) == 1:
        return f"reference {values[0]:g}"
    return ", ".join(f"{name} {value:g}" for name, value in zip(rotations, values, strict=True))
