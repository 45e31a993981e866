"""Six blocks on a desk plane and a hand that can hold them (Wang & Popovic 2009, section 6.1), by MuJoCo.

The hand is five fingertips and a palm: spheres, each driven by a spring and a damper to where the skeleton
has it. So a fingertip inside a block presses on it with a finite force, and friction holds the block.
Fingertips that were simply put in place would have no speed, and blocks would slip through them.
"""

# pyright: reportAttributeAccessIssue=false
# mujoco is compiled and brings no stubs
from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import WRIST
from glovecal_models.hand.skeleton import hand_skeleton

BLOCKS = 6
EDGE_MM = 30.0
TIP_RADIUS_MM, PALM_RADIUS_MM = 8.0, 28.0
PALM_CENTRE_MM = np.array([60.0, 0.0, -10.0])
STEP_S = 0.002
LONGEST_S = 0.1
"""After a longer silence of the stream the desk goes on by this much."""
WOOD_KG_PER_M3 = 600.0
FRICTION = 0.9
STIFFNESS_N_PER_M, SPHERE_KG = 150.0, 0.05
SKELETON = hand_skeleton()

_DOWN = np.array([np.cos(np.radians(50)), 0.0, -np.sin(np.radians(50))])
"""Where bent fingertips point, in the forearm's frame: on the desk that is downwards."""
DESK_FROM_HAND = np.array([[0.0, 1.0, 0.0], np.cross(-_DOWN, [0.0, 1.0, 0.0]), -_DOWN])
"""Rows: the desk's axes (x to the side of the thumb, y away from the wrist, z up) in the forearm's frame."""


@dataclass(frozen=True)
class Scene:
    """What there is to draw; all in mm, in the desk's frame."""

    blocks_mm: np.ndarray
    """(6, 3) centres."""
    turns: np.ndarray
    """(6, 3, 3)."""
    hand_mm: np.ndarray
    """(3,): where the wrist's centre is."""
    angles_deg: np.ndarray


class Desk:
    def __init__(self, blocks_mm: np.ndarray, friction: float = FRICTION) -> None:
        """``blocks_mm`` (6, 3): centres of the blocks at the beginning."""
        self._model = mujoco.MjModel.from_xml_string(_world(np.asarray(blocks_mm), friction))
        self._data = mujoco.MjData(self._model)
        self._hand_mm, self._angles_deg = np.array([0.0, 0.0, 250.0]), np.zeros(len(SKELETON.rotations))
        self._left_over_s = 0.0
        self._begun = False

    @property
    def scene(self) -> Scene:
        places, turns = self._data.xpos[1 : BLOCKS + 1], self._data.xmat[1 : BLOCKS + 1]
        return Scene(1000 * places, turns.reshape(-1, 3, 3).copy(), self._hand_mm, self._angles_deg)

    def advance(self, seconds: float, hand_mm: np.ndarray, angles_deg: np.ndarray) -> None:
        """The desk some time later, with the wrist's centre at ``hand_mm`` (3,) and the hand's angles (R,).

        The wrist's own angles are left out: where the hand points is fixed on this desk.
        """
        self._hand_mm, self._angles_deg = np.array(hand_mm, float), _without_wrist(angles_deg)
        self._data.ctrl[:] = self._targets_m().ravel()
        if not self._begun:
            self._begun = True
            self._data.qpos[7 * BLOCKS :] = self._data.ctrl
            mujoco.mj_forward(self._model, self._data)
        self._left_over_s += float(np.clip(seconds, 0.0, LONGEST_S))
        while self._left_over_s >= STEP_S:
            mujoco.mj_step(self._model, self._data)
            self._left_over_s -= STEP_S

    def take_away(self, block: int) -> None:
        """Put a block far aside, as if it had never been there."""
        self._data.qpos[7 * block : 7 * block + 3] = 1.0, 1.0, EDGE_MM / 2000
        self._data.qvel[6 * block : 6 * block + 6] = 0.0
        mujoco.mj_forward(self._model, self._data)

    def _targets_m(self) -> np.ndarray:
        """(6, 3): fingertips, thumb first, and the palm."""
        tips = forward_kinematics(SKELETON, self._angles_deg[None]).tips_mm[0]
        places = np.vstack([tips, PALM_CENTRE_MM]) @ DESK_FROM_HAND.T + self._hand_mm
        radii = np.array([TIP_RADIUS_MM] * 5 + [PALM_RADIUS_MM])
        places[:, 2] = np.maximum(places[:, 2], radii)  # nobody presses through the desk
        return places / 1000


def pinch_mm(angles_deg: np.ndarray) -> np.ndarray:
    """(3,): the middle between thumb and index and middle finger, from the wrist, in the desk's frame."""
    tips = forward_kinematics(SKELETON, _without_wrist(angles_deg)[None]).tips_mm[0]
    return DESK_FROM_HAND @ (tips[0] + (tips[1] + tips[2]) / 2) / 2


def _without_wrist(angles_deg: np.ndarray) -> np.ndarray:
    still = np.array(angles_deg, float)
    still[[SKELETON.rotations.index(name) for name in WRIST]] = 0.0
    return still


def _world(blocks_mm: np.ndarray, friction: float) -> str:
    half, mass = EDGE_MM / 2000, WOOD_KG_PER_M3 * (EDGE_MM / 1000) ** 3
    boxes = "".join(
        f'<body pos="{x / 1000} {y / 1000} {z / 1000}"><freejoint/>'
        f'<geom type="box" size="{half} {half} {half}" mass="{mass}"/></body>'
        for x, y, z in blocks_mm
    )
    radii = [TIP_RADIUS_MM] * 5 + [PALM_RADIUS_MM]
    spheres = "".join(
        f'<body gravcomp="1"><joint name="x{place}" type="slide" axis="1 0 0"/>'
        f'<joint name="y{place}" type="slide" axis="0 1 0"/>'
        f'<joint name="z{place}" type="slide" axis="0 0 1"/>'
        f'<geom type="sphere" size="{radius / 1000}" mass="{SPHERE_KG}" contype="2" condim="4"/></body>'
        for place, radius in enumerate(radii)
    )
    damping = 2 * np.sqrt(STIFFNESS_N_PER_M * SPHERE_KG)
    springs = "".join(
        f'<position joint="{axis}{place}" kp="{STIFFNESS_N_PER_M}" kv="{damping}"/>'
        for place in range(len(radii))
        for axis in "xyz"
    )
    return f"""
<mujoco>
  <option timestep="{STEP_S}" integrator="implicitfast" cone="elliptic" impratio="10"/>
  <default><geom friction="{friction} 0.02 0.0001" conaffinity="1"/></default>
  <worldbody><geom type="plane" size="2 2 0.1"/>{boxes}{spheres}</worldbody>
  <actuator>{springs}</actuator>
</mujoco>"""
