"""A figure whose legs are the index and middle finger (Wang & Popovic 2009, section 6.1).

Only angles are known, not where the hand is. So the ground is where the lower fingertip is, and the body is
carried by the feet that stand on it: as far as a planted fingertip goes back against the hand, the body goes
forward. A planted foot is held where it came down, and inverse kinematics of the two-link leg reaches it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from stream.hand_stream import Hand

from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.skeleton import hand_skeleton

LEGS = ("I", "M")
THIGH_MM = SHIN_MM = 450.0
STANDING_SHARE = 0.97
"""Of the leg's length, from hip to ground while standing: knees a little bent."""
LAND_MM, LIFT_MM = 30.0, 90.0
"""A foot lands below the first height and lifts above the second: errors of the glove are no steps."""
LOWEST_MM = 300.0
"""Of the hip above the ground."""
AIR_S = 0.12
"""A foot that was off the ground for less has not made a step."""
LET_GO_S = 0.1
"""Time constant with which a lifted foot goes over to where its finger is."""
STAND_S = 1.0
"""At the start the person stands still on both fingers: that pose is the upright one."""

_SKELETON = hand_skeleton()
_TIPS, _KNUCKLES = (1, 2), [[joint.name for joint in _SKELETON.joints].index(f"{leg}_MCP") for leg in LEGS]


@dataclass(frozen=True)
class Leg:
    hip_mm: np.ndarray
    knee_mm: np.ndarray
    foot_mm: np.ndarray
    """(2,) each: forward and up, in the world."""
    planted: bool


class Figure:
    """Follows one hand after another. Before ``STAND_S`` have passed it stands and learns what upright is."""

    def __init__(self) -> None:
        self.steps = 0
        self.hip_mm = np.array([0.0, STANDING_SHARE * (THIGH_MM + SHIN_MM)])
        self._begin: float | None = None
        self._standing: list[np.ndarray] = []
        self._to_legs = np.zeros((2, 2, 2))
        self._fingers: np.ndarray | None = None
        self._pins = np.zeros((2, 2))
        self._offsets = np.zeros((2, 2))
        self._planted = [True, True]
        self._lifted_at = [0.0, 0.0]
        self._seconds = 0.0

    @property
    def standing(self) -> bool:
        """Still learning the upright pose."""
        return self._fingers is None

    @property
    def stretch_mm(self) -> float:
        """How far planted feet are held from where their fingers have slid to, the most of both."""
        return float(max(np.linalg.norm(self._offsets[leg]) * self._planted[leg] for leg in (0, 1)))

    def follow(self, hand: Hand) -> tuple[Leg, Leg]:
        """The legs with the fingers as they are now: index, middle."""
        tips = fingertips_mm(hand.angles_deg)
        if self._begin is None:
            self._begin = hand.seconds
        if self._fingers is None:
            self._seconds = hand.seconds
            self._standing.append(tips)
            if hand.seconds - self._begin >= STAND_S:
                self._learn_upright()
                self._bend()
            upright = np.tile([0.0, -self.hip_mm[1]], (2, 1))
            return self._legs(upright if self._fingers is None else self._fingers)
        step_s = float(np.clip(hand.seconds - self._seconds, 0.0, 0.5))
        self._seconds = hand.seconds
        feet = np.einsum("lab,lb->la", self._to_legs, tips)
        heights = feet[:, 1] - feet[:, 1].min()
        self._carry(feet)
        self._fingers = feet
        for leg in (0, 1):
            self._step(leg, feet[leg], float(heights[leg]), step_s)
        self._bend()
        return self._legs(feet)

    def _learn_upright(self) -> None:
        """Each finger's mean direction and length are an upright leg: fingers are not equally long."""
        mean = np.mean(self._standing, axis=0)
        for leg, (forward, up) in enumerate(mean):
            turn = np.array([[-up, forward], [-forward, -up]]) / np.hypot(forward, up)
            self._to_legs[leg] = STANDING_SHARE * (THIGH_MM + SHIN_MM) / np.hypot(forward, up) * turn
        feet = np.einsum("lab,lb->la", self._to_legs, mean)
        self._fingers = feet
        self.hip_mm = np.array([self.hip_mm[0], -feet[:, 1].min()])
        self._pins = np.column_stack([self.hip_mm[0] + feet[:, 0], np.zeros(2)])
        self._offsets = self._pins - self.hip_mm - feet

    def _carry(self, feet: np.ndarray) -> None:
        """The planted fingers' way backwards is the body's way forward."""
        assert self._fingers is not None
        back = [self._fingers[leg, 0] - feet[leg, 0] for leg in (0, 1) if self._planted[leg]]
        self.hip_mm = np.array([self.hip_mm[0] + np.mean(back), -feet[:, 1].min()])

    def _bend(self) -> None:
        """The hip comes down as far as the legs need to reach what their feet stand on."""
        aways = [abs(self._pins[leg, 0] - self.hip_mm[0]) for leg in (0, 1) if self._planted[leg]]
        highest = np.sqrt(max((THIGH_MM + SHIN_MM) ** 2 - max(aways) ** 2, LOWEST_MM**2))
        self.hip_mm = np.array([self.hip_mm[0], min(self.hip_mm[1], highest)])

    def _step(self, leg: int, foot: np.ndarray, height: float, step_s: float) -> None:
        if self._planted[leg] and height > LIFT_MM:
            self._planted[leg], self._lifted_at[leg] = False, self._seconds
        elif not self._planted[leg] and height < LAND_MM:
            self._planted[leg] = True
            place = self.hip_mm + foot + self._offsets[leg]
            self._pins[leg] = place[0], 0.0
            if self._seconds - self._lifted_at[leg] >= AIR_S:
                self.steps += 1
        if self._planted[leg]:
            self._offsets[leg] = self._pins[leg] - self.hip_mm - foot
        else:
            self._offsets[leg] *= np.exp(-step_s / LET_GO_S)

    def _legs(self, feet: np.ndarray) -> tuple[Leg, Leg]:
        first, second = (self._leg(leg, feet[leg]) for leg in (0, 1))
        return first, second

    def _leg(self, leg: int, foot: np.ndarray) -> Leg:
        place = self._pins[leg] if self._planted[leg] and not self.standing else None
        target = self.hip_mm + foot + self._offsets[leg] if place is None else place
        target = np.array([target[0], max(target[1], 0.0)])
        knee, reached = two_link_leg(self.hip_mm, target)
        return Leg(self.hip_mm, knee, reached, self._planted[leg])


def two_link_leg(hip_mm: np.ndarray, target_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Knee and foot of the leg from the hip to the target, the knee in front.

    By the law of cosines; a target out of reach is approached on a straight leg.
    """
    way = target_mm - hip_mm
    distance = float(np.clip(np.linalg.norm(way), 1.0, THIGH_MM + SHIN_MM))
    direction = way / max(float(np.linalg.norm(way)), 1e-9)
    along = (THIGH_MM**2 - SHIN_MM**2 + distance**2) / (2 * distance)
    aside = np.sqrt(max(THIGH_MM**2 - along**2, 0.0))
    forward = np.array([-direction[1], direction[0]])
    return hip_mm + along * direction + aside * forward, hip_mm + distance * direction


def fingertips_mm(angles_deg: np.ndarray) -> np.ndarray:
    """(2, 2): index and middle fingertip from their knuckles, along the palm and out of its back."""
    still = angles_deg.copy()
    still[-2:] = 0.0  # where the wrist bends to, the ground does not
    frames = forward_kinematics(_SKELETON, still[None])
    return np.array(
        [
            (frames.tips_mm[0, tip] - frames.joints_mm[0, knuckle])[[0, 2]]
            for tip, knuckle in zip(_TIPS, _KNUCKLES, strict=True)
        ]
    )
