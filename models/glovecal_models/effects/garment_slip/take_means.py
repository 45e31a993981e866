"""Whether the takes of several joints differ together: sensors slip each by itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.takes.take import Take

COMMON_JOINTS, COMMON_SHARE = 3, 0.8
"""What moves so many together to this share has a cause outside them."""
FEWEST_COMMON_TAKES = 4


def is_common(takes: Sequence[Take], errors: Sequence[Sequence[np.ndarray]]) -> bool:
    """``errors`` (N,) for each joint and take, degrees: their means, less those of the wearings."""
    if len(errors) < COMMON_JOINTS:
        return False
    known = [number for number in range(len(takes)) if all(np.isfinite(e[number]).any() for e in errors)]
    if len(known) < FEWEST_COMMON_TAKES:
        return False
    means = np.array([[np.nanmean(joint[number]) for joint in errors] for number in known])
    wearings = np.array([takes[number].wearing for number in known])
    for wearing in np.unique(wearings):
        means[wearings == wearing] -= means[wearings == wearing].mean(axis=0)
    means /= np.maximum(np.linalg.norm(means, axis=0), 1e-12)
    together = np.linalg.svd(means, compute_uv=False) ** 2
    return bool(together[0] > COMMON_SHARE * together.sum())
