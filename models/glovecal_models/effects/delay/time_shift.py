"""What effects share that shift glove and reference in time: the reference's clock, the glove's latency.

They are repaired in the measurement, judged by the held-out error, and told apart together.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import ClassVar

import numpy as np

from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.facts import Control, Kind, Motion, Stage
from glovecal_models.effects.base.motions import FAST, TAPS
from glovecal_models.effects.base.problem import Problem
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.base.signature_effect import SignatureEffect
from glovecal_models.effects.delay.delay_grid import (
    DelayErrors,
    delay_errors,
    held_out_beside,
    why_no_delay_shows,
)
from glovecal_models.effects.delay.delay_verdict import FAST_DECIDES_S, ClockChoice, first_delay, taps_decide
from glovecal_models.takes.take import Take


class TimeShift(SignatureEffect):
    """Its first parameter is the shift."""

    kind: ClassVar[Kind] = "repair"
    stage: ClassVar[Stage] = "compared"
    control: ClassVar[Control] = "time-reversed"
    shown_over: ClassVar = "clock shift"
    shown_by: ClassVar = FAST
    looked_for_once: ClassVar[bool] = True

    @abstractmethod
    def choice(self, grids: Sequence[DelayErrors], problem: Problem) -> ClockChoice:
        """The shift that explains most; its control is as large, the other way."""

    @property
    def needs_movement(self) -> bool:
        return True

    def not_applicable_reason(self, takes: Sequence[Signals]) -> str | None:
        return why_no_delay_shows(takes)

    def assess(self, problem: Problem) -> Assessment:
        grids = delay_errors(problem)
        chosen = self.choice(grids, problem)
        errors = held_out_beside(problem, *chosen.errors(grids))
        shifts, nothing = tuple(chosen.offset_s for _ in grids), tuple(np.empty(0) for _ in grids)
        shift = f"{self.parameters[0].name}_s"
        return Assessment(
            self.name, problem.rotations, errors, shifts, nothing, None, (shift,), limits=problem.limits
        )

    def told_from_alikes(self, problem: Callable[[int], Problem]) -> tuple[str, tuple[str, ...]]:
        return first_delay(problem)

    def decided_by(self, motion: Motion, found: Assessment, takes: Sequence[Take]) -> bool:
        late_s = float(np.median(found.shapes[0]))
        if motion == FAST:
            return abs(late_s) >= FAST_DECIDES_S
        measured = next((take.glove_latency for take in takes if take.glove_latency is not None), None)
        return motion != TAPS or taps_decide(late_s, measured)

    def reference_delay_s(self, found: Assessment) -> np.ndarray:
        return found.shapes[0]
