"""The touches of a session that can all be true: one that the likeliest calibration leaves open is not."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.sampling.guided.rotation_belief import RotationBelief
from glovecal_models.sampling.guided.seen_touches import RefusedTouch, SeenTouch
from glovecal_models.sampling.guided.touch_posterior import TouchPosterior

FRAMES_A_TOUCH = 100
"""Of each touch that the search for the likeliest calibration looks at."""
MOST_LEFT_MM = 8.0
"""Between tips under the calibration in which all touches close best; a true touch leaves 1 to 2 mm."""


def closing_touches(
    beliefs: Mapping[str, RotationBelief],
    sensors: Sequence[str],
    skeleton: Skeleton,
    seen: Sequence[SeenTouch],
    cancelled: Callable[[], bool] | None = None,
) -> tuple[TouchPosterior, list[SeenTouch], list[RefusedTouch]]:
    """The likeliest calibration, the touches it rests on, and those that contradict. Raises Cancelled."""
    kept, refused = list(seen), []
    while True:
        touches = [touch.some(FRAMES_A_TOUCH) for touch in kept]
        posterior = TouchPosterior(beliefs, sensors, skeleton, touches, cancelled)
        left = [float(np.median(posterior.apart_mm(touch, skeleton))) for touch in touches]
        if not left or max(left) <= MOST_LEFT_MM:
            return posterior, kept, refused
        strange = kept.pop(int(np.argmax(left)))
        reason = (
            f"with the other touches and poses {max(left):.0f} mm are left between the tips, at most "
            f"{MOST_LEFT_MM:g} are believed. Repeat the motion with the tips together, or check the hand's "
            "dimensions"
        )
        brief = f"{max(left):.0f} mm are left between the tips with the other touches."
        refused.append(RefusedTouch(strange.take.name, strange.pose, reason, brief))
