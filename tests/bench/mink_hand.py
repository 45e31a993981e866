# pyright: reportAttributeAccessIssue=false
"""The same touch with mink, an inverse kinematics library on MuJoCo, on two chains from the exported JSON.

The touch is a task of great cost and the hand's shape one of little, each joint's cost one over its standard
deviation: with the tips together mink minimises what ours does.
"""

from __future__ import annotations

from xml.etree import ElementTree

import mink
import mujoco
import numpy as np

from glovecal_models.hand.rotations import FINGERS, WRIST
from glovecal_models.hand.skeleton import Skeleton, skeleton_document
from glovecal_models.sampling.inverse_kinematics.follow import HandShape

TOUCH_COST = 30.0
"""Per mm, beside the shape's 1 per standard deviation."""
MOST_STEPS = 100


class MinkHand:
    """Thumb and one finger whose joints turn by one rotation each ("I", "M" or "R")."""

    def __init__(self, skeleton: Skeleton, fingers: tuple[str, str]) -> None:
        model = _two_chains(skeleton, fingers)
        self.rotations = tuple(model.joint(index).name for index in range(model.njnt))
        self._configuration = mink.Configuration(model)
        first, second = (FINGERS[finger] for finger in fingers)
        self._touch = mink.RelativeFrameTask(
            first, "site", second, "site", position_cost=TOUCH_COST, orientation_cost=0.0
        )
        self._limits = [mink.ConfigurationLimit(model, gain=1.0)]

    def follow(self, shape: HandShape, reached_mm: float, still_deg: float) -> np.ndarray:
        """Angles (N, K) in degrees, in the order of ``shape``; each frame starts from the one before."""
        columns = [shape.rotations.index(name) for name in self.rotations]
        centre, sd = np.radians(shape.centre_deg[:, columns]), np.radians(shape.sd_deg[:, columns])
        self._configuration.update(np.clip(centre[0], *self._configuration.model.jnt_range.T))
        found = np.empty_like(shape.centre_deg)
        for frame in range(len(shape)):
            posture = mink.PostureTask(self._configuration.model, cost=1 / sd[frame])
            posture.set_target(centre[frame])
            self._settle(posture, reached_mm, np.radians(still_deg))
            found[frame, columns] = np.degrees(self._configuration.q)
        return found

    def _settle(self, posture: mink.PostureTask, reached_mm: float, still: float) -> None:
        self._touch.set_target(mink.SE3.identity())
        for _ in range(MOST_STEPS):
            step = mink.solve_ik(
                self._configuration, [self._touch, posture], 1.0, "daqp", limits=self._limits
            )
            missing = np.linalg.norm(self._touch.compute_error(self._configuration)[:3])
            self._configuration.integrate_inplace(step, 1.0)
            if np.abs(step).max() < still and missing < reached_mm:
                return


def _two_chains(skeleton: Skeleton, fingers: tuple[str, str]) -> mujoco.MjModel:
    document = skeleton_document(skeleton)
    limits = {each["name"]: (each["low"], each["high"]) for each in document["rotations"]}
    root = ElementTree.Element("mujoco")
    ElementTree.SubElement(root, "compiler", angle="degree", autolimits="true")
    bodies = {WRIST[1]: ElementTree.SubElement(root, "worldbody")}
    for joint in document["joints"]:
        if joint["name"][0] not in fingers or joint["name"] in WRIST:
            continue
        body = ElementTree.SubElement(
            bodies[joint["parent"]],
            "body",
            pos=_written(joint["offset"]),
            quat=_written(joint["orientation"]),
        )
        ElementTree.SubElement(body, "inertial", pos="0 0 0", mass="1", diaginertia="1 1 1")
        for rotation in joint["rotations"]:
            limit = _written(limits[rotation])
            ElementTree.SubElement(
                body, "joint", name=rotation, type="hinge", axis=_written(joint["axis"]), range=limit
            )
        bodies[joint["name"]] = body
    for tip in document["tips"]:
        if tip["joint"] in bodies:
            ElementTree.SubElement(
                bodies[tip["joint"]], "site", name=tip["finger"], pos=_written(tip["offset"])
            )
    return mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))


def _written(numbers: list[float] | tuple[float, float]) -> str:
    return " ".join(map(repr, numbers))
