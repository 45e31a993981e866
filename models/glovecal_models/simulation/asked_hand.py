"""A simulated person who does what a sampling protocol asks, as soon as it is asked.

Poses are taken as far from the usual angles as people take them (2.5 degrees), widgets hold exactly, and
nothing is ever quite still. With ``Touches`` the tips of a touch are on each other. Without, they are
near each other: this hand has no skin, so its touches serve the protocol and not the inverse kinematics.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.sampling.protocol import Step
from glovecal_models.simulation.hand_motion import (
    HandMotion,
    PostureSequence,
    Sweep,
    Unrest,
    minimum_jerk,
    posture_vector,
    within_range,
)
from glovecal_models.simulation.protocol import REPEAT_SD_DEG
from glovecal_models.simulation.simulated_hand import DRIVEN, FINGERS, POSTURES
from glovecal_models.simulation.touching import Touches

MOVE_S = 0.7
"""From one thing to the next."""
LONGEST_S = 600.0
_SWINGS: dict[str, tuple[float, float]] = {
    **{f"{finger}_MCP": (-5.0, 90.0) for finger in FINGERS},
    **{f"{finger}_PIP": (0.0, 100.0) for finger in FINGERS},
    **dict.fromkeys(("IM_ABD", "MR_ABD", "RP_ABD"), (0.0, 28.0)),
    "T_TMC": (0.0, 60.0),
    "TI_ABD": (5.0, 66.0),
    "T_MCP": (0.0, 50.0),
    "T_IP": (0.0, 78.0),
    "W_FLEX": (-60.0, 70.0),
    "W_ABD": (-28.0, 19.0),
}
_SPEEDS_HZ = (0.5, 1.2)


@dataclass(frozen=True)
class _Held:
    """The first posture of a motion, kept."""

    motion: HandMotion
    duration_s: float = LONGEST_S

    def driven(self, time_s: np.ndarray) -> np.ndarray:
        return np.repeat(self.motion.driven(np.zeros(1)), len(time_s), axis=0)

    def poses(self, time_s: np.ndarray) -> tuple[str, ...]:
        return self.motion.poses(time_s)


class AskedHand:
    """The hand's driven rotations as a function of time that only goes on."""

    def __init__(self, seed: int, touches: Touches | None = None) -> None:
        self._touches = touches
        self._random = np.random.default_rng([seed, 41])
        self._unrest = Unrest(np.random.default_rng([seed, 42]))
        self._from = posture_vector(POSTURES["rest"])
        self._motion: HandMotion = self._still(self._from, "rest")
        self._began_s = -MOVE_S
        self._held: list[int] = []
        self.asked = ""

    def ask(self, step: Step | None, at_s: float) -> None:
        """Begin ``step``, or rest; what is asked already goes on."""
        name = "" if step is None else step.name
        if name == self.asked:
            return
        self._from = self.driven(np.array([at_s]))[0]
        self.asked, self._began_s = name, at_s
        self._held = [] if step is None else [DRIVEN.index(name) for name in step.angles if name in DRIVEN]
        self._motion = self._rest() if step is None else self._doing(step)

    def driven(self, time_s: np.ndarray) -> np.ndarray:
        """Shape (N, len(DRIVEN)), degrees; ``time_s`` not before the last ``ask``."""
        since = time_s - self._began_s
        angles = self._motion.driven(np.maximum(since - MOVE_S, 0.0))
        share = minimum_jerk(since / MOVE_S)[:, None]
        unrest = self._unrest.driven(time_s)
        if not isinstance(self._motion, PostureSequence):
            unrest[:, self._held] = 0.0  # clamped by the widget, or by skin on skin
        return within_range(self._from + share * (angles - self._from) + unrest)

    def _rest(self) -> HandMotion:
        return self._still(posture_vector(POSTURES["rest"]), "rest")

    def _still(self, posture: np.ndarray, name: str) -> HandMotion:
        taken = within_range(posture + REPEAT_SD_DEG * self._random.standard_normal(len(posture)))
        return PostureSequence(taken[None], [name], hold_s=[LONGEST_S], move_s=[], random=self._random)

    def _doing(self, step: Step) -> HandMotion:
        posture = dict(POSTURES.get(step.pose, POSTURES["ok" if step.touches else "rest"]))
        posture |= {name: angle for name, angle in step.angles.items() if name in posture}
        if step.motion == "hold" and step.touches and self._touches is not None:
            self._held = [column for column, name in enumerate(DRIVEN) if name[0] in step.touches]
            return _Held(self._touches.motion(step, int(self._random.integers(1 << 30))))
        if step.motion == "hold":
            return self._still(posture_vector(posture), step.pose)
        if step.touches and self._touches is not None:
            self._held = [column for column, name in enumerate(DRIVEN) if name[0] in step.touches]
            return self._touches.motion(step, int(self._random.integers(1 << 30)))
        if step.touches:
            near = [name for name in DRIVEN if name.split("_")[0] in step.touches]
            swings = {name: (posture[name] - 14.0, posture[name] + 14.0) for name in near}
        elif step.kind == "range":
            swings = _SWINGS
        else:
            swings = {name: _SWINGS[name] for name in step.moves if name in _SWINGS}
        return self._sweep(posture_vector(posture), swings)

    def _sweep(self, start: np.ndarray, swings: dict[str, tuple[float, float]]) -> HandMotion:
        low, high, speed = start.copy(), start.copy(), np.zeros(len(DRIVEN))
        moving = [DRIVEN.index(name) for name in swings]
        low[moving], high[moving] = np.array(list(swings.values())).T
        speed[moving] = self._random.permutation(np.linspace(*_SPEEDS_HZ, len(moving)))
        phase = self._random.uniform(0, 2 * np.pi, len(DRIVEN))
        return Sweep(start, low, high, speed, phase, LONGEST_S)
