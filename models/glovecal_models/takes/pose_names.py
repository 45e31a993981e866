"""Pose names that came with a reference, carried over to the frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def poses_at_frames(
    time_s: np.ndarray, pose_time_s: np.ndarray, poses: Sequence[str]
) -> tuple[str, ...] | None:
    """The pose named by the latest reference row at or before each frame, "" before the first.

    ``time_s`` (N,) and ``pose_time_s`` (R,) are seconds of one clock; None when no frame has a pose.
    """
    index = np.searchsorted(pose_time_s, time_s, side="right") - 1
    names = ["", *poses]
    named = tuple(names[i + 1] for i in index.tolist())
    return named if any(named) else None
