"""Glove latency: transport, buffers and linear-phase filters make the whole glove late by the same time.

In takes it looks the same as a reference clock that is behind. The measurement is repaired as for the clock:
the reference is read when the hand was where the frame says. Only here live poses are late too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.comparison import Problem
from glovecal_models.effects.base.effect import RepairEffect
from glovecal_models.effects.base.facts import About, Parameter, Shape
from glovecal_models.effects.base.findings import Finding, Proposal, Recorded
from glovecal_models.effects.base.relations import FAST
from glovecal_models.effects.base.signals import Settings
from glovecal_models.effects.delay.delay_comparison import ShiftComparison, large_latency_s
from glovecal_models.effects.delay.delay_grid import DelayErrors
from glovecal_models.effects.delay.delay_verdict import LATENCY, ClockChoice, common_choice
from glovecal_models.takes.clock_scan import aligned
from glovecal_models.takes.take import Take

LONGEST_S = 0.5


class LatencyComparison(ShiftComparison):
    def choice(self, grids: Sequence[DelayErrors], problem: Problem) -> ClockChoice:
        """One delay of all joints and takes, never an advance."""
        return common_choice(grids)

    def constants(self, found: Assessment, takes: Sequence[str]) -> Settings | None:
        """None when the glove is not late."""
        return {"latency_s": float(found.shapes[0][0])} if found.shapes[0].any() else None


class GloveLatency(RepairEffect):
    name = LATENCY
    about = About(
        "The whole glove is late by the same time: its transport, buffers and filters.",
        source="wireless gloves: 10 to 40 ms (Santos, NIME 2021); a linear-phase filter: half its length",
        shown_over="clock shift",
        shown_by=FAST,
    )
    shape = Shape((Parameter("latency", "s", 0.0, LONGEST_S, "10 to 100 ms"),))
    comparison = LatencyComparison(effect=LATENCY, number="latency_s")

    def proposed(self, recorded: Recorded) -> Proposal | None:
        """A latency too large for the comparison, where it was measured."""
        late = large_latency_s(recorded.takes)
        return None if late is None else Proposal({"latency_s": late})

    def find(
        self,
        takes: Sequence[Take],
        sensor_of: Mapping[str, str],
        errors: Sequence[np.ndarray] | None = None,
    ) -> tuple[Finding, ...]:
        """Nothing: it is compared, or measured with taps."""
        return ()

    def described(self, settings: Settings) -> dict[str, Any]:
        return {"latency_s": settings["latency_s"]}

    def repaired(self, takes: Sequence[Take], settings: Settings | None = None) -> tuple[Take, ...]:
        """Without settings by what was measured of the glove."""
        if settings is not None:
            return tuple(aligned(take, -float(settings["latency_s"])) for take in takes)
        return tuple(
            take if take.glove_latency is None else aligned(take, -take.glove_latency.seconds)
            for take in takes
        )
