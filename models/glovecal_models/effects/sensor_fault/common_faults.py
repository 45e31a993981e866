"""Faults of several sensors at one moment: a wire or plug is one sensor's own, what moves most is not.

A supply, a temperature or a tug at the whole glove makes sensors jump together; frames that come in the wrong
order, or twice, make them drop out and spike together.
"""

from __future__ import annotations

from collections.abc import Sequence

from glovecal_models.effects.base.signature_effect import Finding, Stretch

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
    others = [stretch for other in alike if other is not item for stretch in other.stretches]
    together = [any(_begin_alike(stretch, each, item.kind) for each in others) for stretch in item.stretches]
    return sum(together) > MOSTLY_SHARED * len(together)


def _begin_alike(one: Stretch, other: Stretch, kind: str) -> bool:
    return one.take == other.take and abs(one.start_s - other.start_s) <= TOGETHER_S[kind]
