"""How far the reference's clock is from the glove's, as settings of the clock-offset effect."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from glovecal_models.effects.delay.clock_scan import clock_offsets
from glovecal_models.takes.take import Take

BEYOND_DELAYS_S = 0.15
"""Smaller offsets are left to the diagnosis, which tells them from a lag."""


def clock_settings(takes: Sequence[str], delay_s: np.ndarray) -> dict[str, Any]:
    """From a diagnosis: ``delay_s`` (1,) common or (takes,) of how late the readings are."""
    offsets = -np.broadcast_to(delay_s, (len(takes),))
    return {
        "offset_s": dict(zip(takes, map(float, offsets), strict=True)),
        "common_s": float(np.median(offsets)),
        "per_take": bool(np.ptp(offsets) > 0),
    }


def coarse_clock_settings(takes: Sequence[Take]) -> dict[str, Any] | None:
    """Large offsets, each take its own; None unless most takes that can be judged have one."""
    found = clock_offsets(takes)
    judged = [item for item in found if item.verdict in ("offset", "agrees")]
    large = [item for item in judged if item.verdict == "offset" and abs(item.offset_s) > BEYOND_DELAYS_S]
    if not large or 2 * len(large) < len(judged):
        return None
    offsets = {item.take: item.offset_s for item in found if item.verdict == "offset"}
    common = float(np.median(list(offsets.values())))
    return {
        "offset_s": {take.name: offsets.get(take.name, common) for take in takes},
        "common_s": common,
        "per_take": True,
    }
