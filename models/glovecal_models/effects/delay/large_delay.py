"""Delays too large for the comparison of forms: found by the clock scan, take by take.

One offset that all takes share, with readings that come late, may also be a glove that is late; offsets that
differ from take to take beyond their own uncertainty, and readings that come early, cannot.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.takes.clock_scan import COARSE_S, ClockOffset, clock_offsets
from glovecal_models.takes.take import Take

BEYOND_DELAYS_S = 0.15
"""Smaller ones are left to the comparison, which tells them from a lag."""
LATEST_GLOVE_S = 0.5
"""No glove is later: bluetooth with play-out buffers reaches 0.3 s."""
FEWEST_ALIKE = 2


def large_offsets(found: Sequence[ClockOffset]) -> dict[str, float]:
    """Offsets by take; empty unless most takes that can be judged have a large one."""
    judged = [item for item in found if item.verdict in ("offset", "agrees")]
    large = [item for item in judged if item.verdict == "offset" and abs(item.offset_s) > BEYOND_DELAYS_S]
    if not large or 2 * len(large) < len(judged):
        return {}
    return {item.take: item.offset_s for item in found if item.verdict == "offset"}


def is_one_latency(found: Sequence[ClockOffset]) -> bool:
    """Whether large offsets may be a glove's latency: all takes share one, and their readings are late."""
    judged = [item for item in found if item.verdict in ("offset", "agrees")]
    offsets = np.array([item.offset_s for item in judged])
    if len(judged) < FEWEST_ALIKE or (offsets >= 0).any() or offsets.min() < -LATEST_GLOVE_S:
        return False
    return bool(np.ptp(offsets) <= 2 * COARSE_S)


def large_latency_s(takes: Sequence[Take]) -> float | None:
    """The latency of a glove where it is large and was measured to be so; None otherwise."""
    latency = takes[0].glove_latency if takes else None
    if latency is None or latency.seconds <= BEYOND_DELAYS_S:
        return None
    found = clock_offsets(takes)
    offsets = list(large_offsets(found).values())
    if not offsets or not is_one_latency(found):
        return None
    late = -float(np.median(offsets))
    return late if abs(late - latency.seconds) <= max(2 * COARSE_S, 3 * latency.sd_s) else None
