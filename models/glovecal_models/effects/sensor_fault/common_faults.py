"""Faults of several sensors at one moment: a wire or plug is one sensor's own, what moves most is not.

A supply, a temperature or a tug at the whole glove makes sensors jump together; frames that come in the wrong
order, or twice, make them drop out and spike together.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence

from glovecal_models.effects.base.findings import Finding

FEWEST_TOGETHER = 3
TOGETHER_S = {"jump": 0.5, "dropouts": 0.05, "spikes": 0.05}
"""So far apart they may begin, by kind; other kinds are not looked at."""
MOSTLY_SHARED = 0.5
"""Share of a sensor's moments."""


def without_common_faults(found: Sequence[Finding], sensors: int) -> list[Finding]:
    """``found`` without the jumps, dropouts and spikes of at least three, and half of so many ``sensors``,
    which each has at a moment of another mostly: a sensor that rests hardly shows what happens to all."""
    common: list[Finding] = []
    for kind in TOGETHER_S:
        alike = [item for item in found if item.kind == kind]
        shared = [item for item in alike if _is_shared(item, alike)]
        if len(shared) >= max(FEWEST_TOGETHER, sensors / 2):
            common += shared
    return [item for item in found if item not in common]


def _is_shared(item: Finding, alike: Sequence[Finding]) -> bool:
    begins: dict[str, list[float]] = {}
    for other in alike:
        for stretch in other.stretches if other is not item else ():
            begins.setdefault(stretch.take, []).append(stretch.start_s)
    for starts in begins.values():
        starts.sort()
    within = TOGETHER_S[item.kind]
    together = [_is_near(each.start_s, begins.get(each.take, []), within) for each in item.stretches]
    return sum(together) > MOSTLY_SHARED * len(together)


def _is_near(moment_s: float, starts: Sequence[float], within_s: float) -> bool:
    """Whether one of rising ``starts`` is; a noisy sensor has thousands."""
    place = bisect_left(starts, moment_s - within_s)
    return place < len(starts) and starts[place] <= moment_s + within_s
