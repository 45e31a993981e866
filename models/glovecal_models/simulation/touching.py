"""A simulated hand that keeps thumb and fingertip together while it moves (Wang & Neff 2013, Figure 6).

Its tips touch by the person's own rules for joints that no sensor reads, not by the calibration's. A person
who is asked to do so keeps two fingertips together, or a rod between them.

A simulated person who does what a sampling protocol asks, as soon as it is asked.

Poses are taken as far from the usual angles as people take them (2.5 degrees), widgets hold exactly, and
nothing is ever quite still. With ``Touches`` the tips of a touch are on each other. Without, they are
near each other: this hand has no skin, so its touches serve the protocol and not the inverse kinematics.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import FINGERS
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.sampling.inverse_kinematics.contact import TipChains
from glovecal_models.sampling.protocol import Step
from glovecal_models.simulation.protocol import (
    GAPS,
    REPEAT_SD_DEG,
    HandMotion,
    PostureSequence,
    Segment,
    Sweep,
    Unrest,
    minimum_jerk,
    posture_vector,
    within_range,
)
from glovecal_models.simulation.simulated_hand import DRIVEN, LONG_FINGERS, POSTURES, ROTATIONS, SimulatedHand

TABLE_HZ = 120.0
WAVES_DEG = {"MCP": 12.0, "PIP": 14.0, "ABD": 4.0, "TMC": 4.0, "IP": 8.0}
"""How far the joints of both fingers are meant to swing, by the end of their names."""
WAVES_HZ = (0.15, 0.45)
TOUCHING_MM = 1e-3
MOST_STEPS = 200
SLOPE_STEP_DEG = 1e-4
LONGEST_STEP_DEG = 8.0
SINGULAR = 1e-3
"""A rod holds one direction only: what moves the tips in others is left alone."""
_THUMB = ("T_TMC", "TI_ABD", "T_MCP", "T_IP")
_NEAR_TOUCH = {
    "I": {**dict(zip(_THUMB, (36.0, 22.0, 13.0, 14.0), strict=True)), "I_MCP": 46.0, "I_PIP": 56.0},
    "M": {**dict(zip(_THUMB, (48.0, 17.0, 16.0, 15.0), strict=True)), "M_MCP": 47.0, "M_PIP": 60.0},
    "R": {**dict(zip(_THUMB, (52.0, 12.0, 20.0, 15.0), strict=True)), "R_MCP": 44.0, "R_PIP": 59.0},
    "P": {**dict(zip(_THUMB, (48.0, 8.0, 24.0, 20.0), strict=True)), "P_MCP": 40.0, "P_PIP": 55.0},
}
MOVE_S = 0.7
"""From one thing to the next."""
LONGEST_S = 600.0
_SWINGS: dict[str, tuple[float, float]] = {
    **{f"{finger}_MCP": (-5.0, 90.0) for finger in LONG_FINGERS},
    **{f"{finger}_PIP": (0.0, 100.0) for finger in LONG_FINGERS},
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
class TouchingMotion:
    """Driven rotations at ``TABLE_HZ``, (N, len(DRIVEN)) degrees; between them a straight line."""

    table: np.ndarray
    name: str

    @property
    def duration_s(self) -> float:
        return (len(self.table) - 1) / TABLE_HZ

    def driven(self, time_s: np.ndarray) -> np.ndarray:
        at = np.clip(time_s * TABLE_HZ, 0, len(self.table) - 1)
        before = np.minimum(at.astype(int), len(self.table) - 2)
        share = (at - before)[:, None]
        return (1 - share) * self.table[before] + share * self.table[before + 1]

    def poses(self, time_s: np.ndarray) -> tuple[str, ...]:
        return (self.name,) * len(time_s)


def touching_segment(
    hand: SimulatedHand,
    skeleton: Skeleton,
    finger: str,
    seed: int,
    duration_s: float = 3.0,
    *,
    rod_mm: float = 0.0,
    posture_gain: float = 1.0,
) -> Segment:
    """Thumb and ``finger`` ("I", "M", "R" or "P") touching from beginning to end, or a rod between them.

    ``posture_gain`` makes the waves larger and quicker.

    Raises BadInput for another finger, and for a hand of ``skeleton`` whose tips cannot stay together.
    """
    if finger not in _NEAR_TOUCH:
        raise BadInput(f"the thumb touches {', '.join(_NEAR_TOUCH)}, not {finger!r}")
    random = np.random.default_rng([seed, 15, list(FINGERS).index(finger)])
    name = f"rod_{FINGERS[finger]}" if rod_mm else f"touch_{FINGERS[finger]}"
    tips = _Tips(hand, skeleton, finger, rod_mm)
    near = posture_vector(POSTURES["ok"] | _NEAR_TOUCH[finger] | dict.fromkeys(GAPS, 4.0))
    touching = _brought_together(near[None], tips)
    meant = _waving(touching, finger, random, int(np.ceil(duration_s * TABLE_HZ)) + 1, posture_gain)
    table = _brought_together(meant, tips)
    return Segment(name, TouchingMotion(table, name), Unrest(random, held=DRIVEN))


def _waving(
    posture: np.ndarray, finger: str, random: np.random.Generator, frames: int, posture_gain: float
) -> np.ndarray:
    """Slow waves of the two fingers about ``posture`` (1, len(DRIVEN))."""
    table = np.tile(posture, (frames, 1))
    time = np.arange(frames) / TABLE_HZ
    for column, name in enumerate(DRIVEN):
        size = WAVES_DEG.get(name.partition("_")[2], 0.0) if name[0] in ("T", finger) else 0.0
        size, speed = posture_gain * size, posture_gain * random.uniform(*WAVES_HZ)
        phase = random.uniform(0, 2 * np.pi)
        table[:, column] += size * np.sin(2 * np.pi * speed * time + phase)
    return within_range(table)


@dataclass(frozen=True)
class _Tips:
    """Of the thumb and one finger of a person, and the rod between them."""

    hand: SimulatedHand
    skeleton: Skeleton
    finger: str
    rod_mm: float

    @cached_property
    def chains(self) -> TipChains:
        return TipChains(self.skeleton, ("T", self.finger))

    @cached_property
    def _columns(self) -> list[int]:
        return [ROTATIONS.index(name) for name in self.chains.rotations]

    @property
    def moving(self) -> list[int]:
        """Columns of ``DRIVEN``."""
        joints = (*self.skeleton.chain("T"), *self.skeleton.chain(self.finger))
        return [column for column, name in enumerate(DRIVEN) if name in joints]

    def gap_mm(self, driven: np.ndarray) -> np.ndarray:
        """What is to go from where the finger should be to the tip of the thumb, (N, 3)."""
        angles = self.hand.complete(dict(zip(DRIVEN, driven.T, strict=True)))
        thumb, finger = self.chains.tips_mm(angles[:, self._columns]).transpose(1, 0, 2)
        apart = thumb - finger
        if not self.rod_mm:
            return apart
        return apart * (1 - self.rod_mm / np.linalg.norm(apart, axis=1, keepdims=True))


def _brought_together(table: np.ndarray, tips: _Tips) -> np.ndarray:
    """Each frame changed as little as it takes for the tips to touch; joints stay within their ranges."""
    moving, table = tips.moving, table.copy()
    gap = tips.gap_mm(table)
    for _ in range(MOST_STEPS):
        apart = np.flatnonzero(np.abs(gap).max(axis=1) >= TOUCHING_MM)
        if not len(apart):
            return table
        now = table[apart]
        slopes = np.empty((len(apart), 3, len(moving)))
        for place, column in enumerate(moving):
            ahead = now.copy()
            ahead[:, column] += SLOPE_STEP_DEG
            slopes[:, :, place] = (tips.gap_mm(ahead) - gap[apart]) / SLOPE_STEP_DEG
        step = -(np.linalg.pinv(slopes, rcond=SINGULAR) @ gap[apart][:, :, None])[:, :, 0]
        now[:, moving] += np.clip(step, -LONGEST_STEP_DEG, LONGEST_STEP_DEG)
        table[apart] = within_range(now)
        gap[apart] = tips.gap_mm(table[apart])
    furthest = np.linalg.norm(gap, axis=1).max()
    raise BadInput(
        f"thumb and {FINGERS[tips.finger]} of this hand cannot stay together: {furthest:.1f} mm are between "
        "them"
    )


LONGEST_TOUCH_S = 8.0
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
            LONGEST_TOUCH_S,
            rod_mm=step.rod_mm or 0.0,
            posture_gain=EAGERNESS,
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
