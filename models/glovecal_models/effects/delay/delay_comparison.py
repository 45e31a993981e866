"""How delays are compared: the lag of sensors, the reference's clock and the glove's latency.

One grid of delays and forms serves all three, and they are told apart together. Two of them shift glove and
reference in time: they are repaired in the measurement.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.comparison import EffectComparison, Problem
from glovecal_models.effects.base.relations import FAST, TAPS, Motion
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.delay.delay_grid import (
    DelayErrors,
    delay_errors,
    held_out_beside,
    why_no_delay_shows,
)
from glovecal_models.effects.delay.delay_spread import shows_spread
from glovecal_models.effects.delay.delay_verdict import (
    FAST_DECIDES_S,
    ClockChoice,
    first_delay,
    if_the_glove_is_late,
    taps_decide,
)
from glovecal_models.takes.clock_scan import COARSE_S, ClockOffset, clock_offsets
from glovecal_models.takes.take import Take


@dataclass(frozen=True)
class DelayComparison(EffectComparison):
    """What the three share."""

    needs_movement: bool = True

    def not_applicable_reason(self, takes: Sequence[Signals]) -> str | None:
        return why_no_delay_shows(takes)

    def first_of_alike(self, problem: Callable[[int], Problem]) -> tuple[str, tuple[str, ...]]:
        return first_delay(problem)

    def decided_by(self, motion: Motion, found: Assessment, takes: Sequence[Signals]) -> bool:
        return motion != FAST or not shows_spread(takes)


@dataclass(frozen=True, kw_only=True)
class ShiftComparison(DelayComparison):
    """Of glove and reference."""

    effect: str
    number: str
    """The shift's name, with its unit."""

    @abstractmethod
    def choice(self, grids: Sequence[DelayErrors], problem: Problem) -> ClockChoice:
        """The shift that explains most; its control is as large, the other way."""

    def assess(self, problem: Problem) -> Assessment:
        grids = delay_errors(problem)
        chosen = self.choice(grids, problem)
        errors = held_out_beside(problem, *chosen.errors(grids))
        shifts, nothing = tuple(chosen.offset_s for _ in grids), tuple(np.empty(0) for _ in grids)
        return Assessment(
            self.effect, problem.rotations, errors, shifts, nothing, None, (self.number,),
            limits=problem.limits,
        )  # fmt: skip

    def reference_delay_s(self, found: Assessment) -> np.ndarray:
        return found.shapes[0]

    def decided_by(self, motion: Motion, found: Assessment, takes: Sequence[Signals]) -> bool:
        late_s = float(np.median(found.shapes[0]))
        measured = next((take.glove_latency for take in takes if take.glove_latency is not None), None)
        if motion == FAST:
            # Without a lag the clock and the glove would be left, if taps cannot tell those.
            settles = measured is not None or taps_decide(late_s, None)
            return settles and abs(late_s) >= FAST_DECIDES_S and super().decided_by(motion, found, takes)
        return motion != TAPS or taps_decide(late_s, measured)

    def consequence(self, found: Assessment, confidence_set: Sequence[str]) -> str:
        return if_the_glove_is_late(float(np.median(found.shapes[0])), confidence_set)


# Delays too large for the comparison of forms: found by the clock scan, take by take. One offset that all
# takes share, with readings that come late, may also be a glove that is late; offsets that differ from take
# to take beyond their own uncertainty, and readings that come early, cannot.


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
