"""A simulated hand that keeps thumb and fingertip together while it moves (Wang & Neff 2013, Figure 6).

Its tips touch by the person's own rules for joints that no sensor reads, not by the calibration's. A person
who is asked to do so keeps two fingertips together, or a rod between them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import FINGERS
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.inverse_kinematics.tip_chains import TipChains
from glovecal_models.sampling.protocol import Step
from glovecal_models.simulation.hand_motion import HandMotion, Unrest, posture_vector, within_range
from glovecal_models.simulation.protocol import GAPS, Segment
from glovecal_models.simulation.simulated_hand import DRIVEN, POSTURES, ROTATIONS, SimulatedHand

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
