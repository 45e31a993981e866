"""Jumps of several sensors at one moment: a wire or plug is one sensor's own, what moves most is not."""

from __future__ import annotations

from collections.abc import Sequence

from glovecal_models.effects.base.signature_effect import Finding, Stretch

FEWEST_TOGETHER = 3
TOGETHER_S = 0.5


def without_common_jumps(found: Sequence[Finding], sensors: int) -> list[Finding]:
    """``found`` without the jumps that at least three, and half of so many ``sensors``, make together: a
    supply, a temperature or a tug at the whole glove."""
    jumps = [item for item in found if item.kind == "jump"]
    return [item for item in found if item.kind != "jump" or not _is_common(item, jumps, sensors)]


def _is_common(jump: Finding, jumps: Sequence[Finding], sensors: int) -> bool:
    """Whether each of its moments is that of others, too."""
    for stretch in jump.stretches:
        together = sum(any(_begin_alike(stretch, each) for each in item.stretches) for item in jumps)
        if together < max(FEWEST_TOGETHER, sensors / 2):
            return False
    return bool(jump.stretches)


def _begin_alike(one: Stretch, other: Stretch) -> bool:
    return one.take == other.take and abs(one.start_s - other.start_s) <= TOGETHER_S
