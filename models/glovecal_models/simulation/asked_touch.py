"""What a simulated person does who is asked to keep two fingertips together, or a rod between them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.sampling.step import Step
from glovecal_models.simulation.hand_motion import HandMotion
from glovecal_models.simulation.simulated_hand import SimulatedHand
from glovecal_models.simulation.touching import touching_segment

TOUCHING_S = 8.0
EAGERNESS = 2.0
"""A person who is asked to move does so more than one who is left to it."""


class Touches(Protocol):
    def motion(self, step: Step, seed: int) -> HandMotion:
        """Of a step that names the tips that touch."""
        ...


@dataclass(frozen=True)
class RealTouches:
    """Motions of one person in which the tips are where the step wants them, to the end."""

    hand: SimulatedHand
    skeleton: Skeleton

    def motion(self, step: Step, seed: int) -> HandMotion:
        """Raises BadInput where this hand cannot."""
        touching = touching_segment(
            self.hand,
            self.skeleton,
            step.touches[1],
            seed,
            TOUCHING_S,
            rod_mm=step.rod_mm or 0.0,
            eagerness=EAGERNESS,
        )
        return _ToAndFro(touching.motion)


@dataclass(frozen=True)
class PreparedTouches:
    """Touches worked out beforehand: who simulates a live glove has no second to spare between two frames."""

    touches: RealTouches
    seed: int
    _motions: dict[str, HandMotion] = field(default_factory=dict)

    def prepare(self, step: Step) -> None:
        """From any thread. Raises BadInput where this hand cannot."""
        if step.touches and step.name not in self._motions:
            self._motions[step.name] = self.touches.motion(step, self.seed)

    def motion(self, step: Step, seed: int) -> HandMotion:
        return self._motions[step.name]


@dataclass(frozen=True)
class _ToAndFro:
    """A motion, then back, then again."""

    once: HandMotion

    @property
    def duration_s(self) -> float:
        return 2 * self.once.duration_s

    def driven(self, time_s: np.ndarray) -> np.ndarray:
        return self.once.driven(
            self.once.duration_s - np.abs(self.once.duration_s - time_s % self.duration_s)
        )

    def poses(self, time_s: np.ndarray) -> tuple[str, ...]:
        return self.once.poses(time_s)
