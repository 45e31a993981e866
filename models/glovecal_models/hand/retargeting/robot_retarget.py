"""Joint angles of a robot's hand that show what a hand does, within the robot's limits.

A robot has other joints than a hand: fewer, about other axes, in another order. So no angle is copied. Sought
are the angles with which its bones point where the hand's point, seen from the palm, and with which its
fingertips stand to its thumb's as the hand's do where these come near (damped least squares after Levenberg
and Marquardt, a joint at its limit left out). A straight finger is straight, as far as the robot goes, and a
pinch a pinch.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.bones import DISTAL, HAND, METACARPAL, PHALANGES, HandBones
from glovecal_models.hand.retargeting.bone_names import TIP
from glovecal_models.hand.retargeting.robot import RobotHand
from glovecal_models.hand.retargeting.touches import nearness
from glovecal_models.hand.retargeting.turns import cross
from glovecal_models.hand.skeleton import Skeleton

MOST_STEPS, MOST_STEPS_FROM_BEFORE = 40, 4
"""Of Levenberg and Marquardt: from the middle of the limits, and from what the frame before ended in."""
SETTLED = 1e-3
"""Radians of every joint in a step: then no more are taken."""
JOINT_DAMPING = 0.02
"""Of a step, and of how far a joint that nothing tells is from the middle of its limits; a radian of a joint
against a radian of a bone."""
TOUCH_WEIGHT = 6.0
"""Of fingertips that touch, a hand's finger length away, against a bone that points a radian away."""
BEND_WEIGHT = 0.3
"""Of the axis about which a finger bends, a radian from the hand's: some robots turn a straight finger about
its own length, which where it points does not tell."""
_WEIGHTS = {f"thumb_{METACARPAL}": 0.3}
"""Robots' thumbs stand elsewhere on the palm, so their first bone cannot point as a hand's."""


@dataclass(frozen=True)
class RobotRetargeting:
    """From one hand to one robot. Raises BadInput where they have no two fingers in common."""

    skeleton: Skeleton
    robot: RobotHand

    def __post_init__(self) -> None:
        if len(self.fingers) < 2:
            raise BadInput("the hand and the robot have no two fingers in common")

    @property
    def fingers(self) -> tuple[str, ...]:
        return self.robot.fingers

    @property
    def turns_wrist(self) -> bool:
        """Whether a joint moves the hand itself."""
        return bool(self._moved[-1].any())

    @property
    def palm(self) -> np.ndarray:
        """(3, 3) axes of the hand in which joints are told: its own."""
        return np.eye(3)

    @property
    def mapping(self) -> dict[str, str]:
        """The robot's link by the hand's bone."""
        return dict(self.robot.links)

    @property
    def choices(self) -> tuple[str, ...]:
        """Names of the robot's links."""
        return self.robot.every_link

    def shown_joints_mm(self, angles_deg: np.ndarray) -> np.ndarray:
        """``joints`` of a hand's angles."""
        return self.joints(self.radians(angles_deg))

    def radians(self, angles_deg: np.ndarray, before: np.ndarray | None = None) -> np.ndarray:
        """(N, J) of the robot's joints ``robot.free``, within their limits; of ``angles_deg`` (N, R) in the
        order of the skeleton's rotations. ``before`` (J,): what the frame before ended in, as a start."""
        segments, places = self._bones.posed(angles_deg)
        hand = segments[:, self._bones.names.index(HAND)]
        bends = hand.swapaxes(1, 2)[:, None] @ segments[:, self._bent][..., 1:2]
        tips = self._own_joints(places)[:, :, -1]
        gaps = tips[:, 1:] - tips[:, :1] if self._has_thumb else np.zeros((len(tips), 0, 3))
        weights = nearness(np.linalg.norm(gaps, axis=2))
        along = places[:, self._segments, 1] - places[:, self._segments, 0]
        along = along / np.linalg.norm(along, axis=2, keepdims=True) @ hand  # seen from the hand
        gaps = gaps @ hand * self.units_a_mm
        low, high = self.robot.limits.T
        middle = (low + high) / 2
        angles = np.tile(middle if before is None else np.clip(before, low, high), (len(hand), 1))
        wanted = (hand, along, bends[..., 0], gaps, weights)
        moving = np.arange(len(angles))
        for _ in range(MOST_STEPS if before is None else MOST_STEPS_FROM_BEFORE):
            stepped = self._better(angles[moving], *(each[moving] for each in wanted))
            moved = np.abs(stepped - angles[moving]).max(axis=1) > SETTLED
            angles[moving] = stepped
            moving = moving[moved]
            if not len(moving):
                break
        return angles

    def joints(self, radians: np.ndarray) -> np.ndarray:
        """(N, F, K + 1, 3) of the robot's fingers: where their bones begin and the last ends, from the hand's
        link and in its axes, in the hand's size, mm."""
        places, hand, turn = self._points(*self.robot.posed(radians))
        seen = (places - hand[:, None]) @ turn / self.units_a_mm
        return seen.reshape(len(seen), len(self.fingers), -1, 3)

    def own_joints_mm(self, angles_deg: np.ndarray) -> np.ndarray:
        """As ``joints``, of the hand itself."""
        segments, places = self._bones.posed(angles_deg)
        at = self._bones.names.index(HAND)
        return (self._own_joints(places) - places[:, None, None, at, 0]) @ segments[:, None, at]

    @cached_property
    def units_a_mm(self) -> float:
        """The robot's millimetres for one of the hand: by the lengths of their fingers, knuckle to tip."""
        own = np.linalg.norm(self._bones.tails_mm[self._segments], axis=1).sum()
        middle = self.robot.limits.mean(axis=1)[None]
        places = self._points(*self.robot.posed(middle))[0][0].reshape(len(self.fingers), -1, 3)
        return float(np.linalg.norm(np.diff(places, axis=1), axis=2).sum() / own)

    @cached_property
    def _bones(self) -> HandBones:
        return HandBones.of(self.skeleton)

    @property
    def _has_thumb(self) -> bool:
        return self.fingers[0] == "thumb"

    @cached_property
    def _segments(self) -> list[int]:
        """Of every finger's bones, in the hand's."""
        names = [f"{finger}_{part}" for finger in self.fingers for part in PHALANGES[finger]]
        return [self._bones.names.index(name) for name in names]

    @cached_property
    def _bending(self) -> list[str]:
        """Last bones of the fingers, the thumb's not, that hang on a hinge of their own."""
        names = [f"{finger}_{DISTAL}" for finger in self.fingers if finger != "thumb"]
        return [name for name in names if self.robot.points[name][0] is not None]

    @cached_property
    def _bent(self) -> list[int]:
        return [self._bones.names.index(name) for name in self._bending]

    @cached_property
    def _bend_hinges(self) -> tuple[list[int], np.ndarray]:
        """Their hinges, and (D,) the sign that makes each bend towards the palm: a finger's axes point across
        the palm, however it is bent."""
        hinges = [self.robot.points[name][0] for name in self._bending]
        numbers = [hinge for hinge in hinges if hinge is not None]
        orientations, places = self.robot.posed(self.robot.limits.mean(axis=1)[None])
        across = self._points(orientations, places)[2][0, :, 1]
        axes = orientations[0, numbers] @ np.array([self.robot.joints[at].axis for at in numbers])[:, :, None]
        return numbers, np.where(axes[..., 0] @ across < 0, -1.0, 1.0)

    def _own_joints(self, places: np.ndarray) -> np.ndarray:
        """(N, F, K + 1, 3) in the forearm's frame, of (N, B, 2, 3)."""
        ends = places[:, self._segments].reshape(len(places), len(self.fingers), -1, 2, 3)
        return np.concatenate([ends[:, :, :, 0], ends[:, :, -1:, 1]], axis=2)

    @cached_property
    def _asked(self) -> list[str]:
        """Points of the robot: of every finger its bones and its tip."""
        return [f"{finger}_{part}" for finger in self.fingers for part in (*PHALANGES[finger], TIP)]

    @cached_property
    def _moved(self) -> np.ndarray:
        """(P + 1, H) bool: which hinges move a point against the hand's link, and last that link itself."""
        root = np.zeros(len(self.robot.joints), dtype=bool)
        own = [self.robot.points[name][0] for name in (*self._asked, HAND)]
        moved = np.array([root if hinge is None else self.robot.ancestors[hinge] for hinge in own])
        moved[:-1] &= ~moved[-1]
        return moved

    def _points(
        self, orientations: np.ndarray, places: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(N, P, 3) points, (N, 3) and (N, 3, 3) the hand's link."""
        count = len(places)
        orientations = np.concatenate([orientations, np.tile(np.eye(3), (count, 1, 1, 1))], axis=1)
        places = np.concatenate([places, np.zeros((count, 1, 3))], axis=1)
        hinges, own = self._fastened
        points = places[:, hinges] + (orientations[:, hinges] @ own[:, :, None])[..., 0]
        return points[:, :-1], points[:, -1], orientations[:, hinges[-1]] @ self.robot.points[HAND][2]

    @cached_property
    def _fastened(self) -> tuple[list[int], np.ndarray]:
        """Hinge (-1: the root) and place (P + 1, 3) of the points and of the hand's link."""
        points = [self.robot.points[name] for name in (*self._asked, HAND)]
        return [-1 if hinge is None else hinge for hinge, _, _ in points], np.array(
            [each[1] for each in points]
        )

    @cached_property
    def _straight(self) -> np.ndarray:
        """(3, 3) the hand's link where the robot's wrist is at 0."""
        return self._points(*self.robot.posed(np.zeros((1, len(self.robot.free)))))[2][0]

    def _better(
        self,
        radians: np.ndarray,
        hand: np.ndarray,
        along: np.ndarray,
        bends: np.ndarray,
        gaps: np.ndarray,
        weights: np.ndarray,
    ) -> np.ndarray:
        """One step. ``hand`` (N, 3, 3) against the forearm; seen from the hand: ``along`` (N, S, 3) bones,
        ``bends`` (N, D, 3) axes of the last joints, ``gaps`` (N, G, 3) from the thumb's tip in the robot's
        size, of ``weights`` (N, G)."""
        count, fingers = len(radians), len(self.fingers)
        orientations, places = self.robot.posed(radians)
        points, _, turned = self._points(orientations, places)
        axes = orientations @ np.array([joint.axis for joint in self.robot.joints])[:, :, None]
        axes = axes[..., 0]
        arms = points[:, :, None] - places[:, None]
        moves = cross(axes[:, None], arms) * self._moved[:-1, :, None]  # (N, P, H, 3)
        by_finger = points.reshape(count, fingers, -1, 3)
        moves = moves.reshape(count, fingers, by_finger.shape[2], -1, 3)
        bones = np.diff(by_finger, axis=2).reshape(count, -1, 3)
        lengths = np.linalg.norm(bones, axis=2)
        shown = bones / lengths[..., None]
        turns = np.diff(moves, axis=2).reshape(count, shown.shape[1], -1, 3)
        turns -= shown[:, :, None] * (turns * shown[:, :, None]).sum(axis=3, keepdims=True)
        turns *= (self._bone_weights / lengths)[..., None, None]
        away = self._bone_weights[:, None] * (shown - along @ turned.swapaxes(1, 2))
        numbers, signs = self._bend_hinges
        own = axes[:, numbers] * signs[:, None]
        moved = (self.robot.ancestors[numbers] & ~self._moved[-1])[:, :, None]
        rows = [turns, BEND_WEIGHT * cross(axes[:, None], own[:, :, None]) * moved]
        lacks = [away, BEND_WEIGHT * (own - bends @ turned.swapaxes(1, 2))]
        if gaps.shape[1]:
            tips, tip_moves = by_finger[:, :, -1], moves[:, :, -1]
            scale = TOUCH_WEIGHT * weights / (self.units_a_mm * self._finger_mm)
            apart = tips[:, 1:] - tips[:, :1] - gaps @ turned.swapaxes(1, 2)
            rows.append(scale[..., None, None] * (tip_moves[:, 1:] - tip_moves[:, :1]))
            lacks.append(scale[..., None] * apart)
        if self.turns_wrist:
            wanted = self._straight @ hand
            for column in (0, 2):
                own = turned[:, None, :, column]
                rows.append((cross(axes, own) * self._moved[-1][:, None])[:, None])
                lacks.append(own - wanted[:, None, :, column])
        jacobian = np.concatenate(rows, axis=1).swapaxes(2, 3).reshape(count, -1, len(self.robot.joints))
        jacobian = jacobian @ self.robot.follows
        lack = np.concatenate(lacks, axis=1).reshape(count, -1, 1)
        return self._stepped(radians, jacobian, lack)

    def _stepped(self, radians: np.ndarray, jacobian: np.ndarray, lack: np.ndarray) -> np.ndarray:
        low, high = self.robot.limits.T
        pull = JOINT_DAMPING**2 * (radians - (low + high) / 2)
        gradient = (jacobian.swapaxes(1, 2) @ lack)[..., 0] + pull
        stuck = ((radians <= low) & (gradient > 0)) | ((radians >= high) & (gradient < 0))
        jacobian = np.where(stuck[:, None], 0.0, jacobian)
        square = jacobian.swapaxes(1, 2) @ jacobian + 2 * JOINT_DAMPING**2 * np.eye(len(low))
        step = np.linalg.solve(square, np.where(stuck, 0.0, -gradient)[..., None])[..., 0]
        return np.clip(radians + np.clip(step, -LARGEST_TURN, LARGEST_TURN), low, high)

    @cached_property
    def _bone_weights(self) -> np.ndarray:
        return np.array([_WEIGHTS.get(self._bones.names[segment], 1.0) for segment in self._segments])

    @cached_property
    def _finger_mm(self) -> float:
        """The mean length of the hand's fingers, knuckle to tip."""
        return float(np.linalg.norm(self._bones.tails_mm[self._segments], axis=1).sum() / len(self.fingers))


LARGEST_TURN = 0.5
"""Radians of a joint in one step: bones that point the other way would throw it from limit to limit."""
