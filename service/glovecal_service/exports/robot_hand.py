"""A subject's hand for robotics: URDF (ROS) and MJCF (MuJoCo), with the hand's own kinematics.

Joints have the names of the rotations, so that the joint states of the ROS 2 bridge move the hand as they
are; radians and metres. A rotation that turns two joints, as the spread between ring and middle finger
carries the little finger too, moves the first, and the second mimics it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal
from xml.etree import ElementTree

import numpy as np

from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, FINGERS
from glovecal_models.hand.skeleton import Joint, Skeleton

RobotForm = Literal["urdf", "mjcf"]
M_PER_MM = 1e-3
ROOT = "forearm"
RADIUS_M, MASS_KG, INERTIA = 0.007, 0.02, 4e-6
"""Of each link, which a simulator wants: a finger's bone is about as thick and heavy."""
EFFORT_NM, SPEED_RAD_S = 1.0, 15.0
ARMATURE, DAMPING = 5e-4, 0.02
"""Of each hinge, kg m2 and N m s: without them a chain of light links is not simulated steadily."""
_NOTHING = "0 0 0"


@dataclass(frozen=True)
class Hinge:
    """One rotation about one joint's axis."""

    name: str
    """That of the rotation where it is the first that it turns."""
    joint: Joint
    rotation: str
    mimics: bool


def robot_hand(skeleton: Skeleton, form: RobotForm) -> str:
    """The hand as an XML text."""
    return urdf(skeleton) if form == "urdf" else mjcf(skeleton)


def hinges(skeleton: Skeleton) -> dict[str, list[Hinge]]:
    """By joint, in the skeleton's order; none where a joint never turns."""
    first: set[str] = set()
    by_joint: dict[str, list[Hinge]] = {}
    for joint in skeleton.joints:
        by_joint[joint.name] = []
        for rotation, weight in joint.rotations.items():
            assert weight == 1.0, f"{joint.name} turns by {weight} of {rotation}"
            mimics = rotation in first
            name = f"{joint.name}_{rotation}" if mimics else rotation
            by_joint[joint.name].append(Hinge(name, joint, rotation, mimics))
            first.add(rotation)
    return by_joint


def urdf(skeleton: Skeleton) -> str:
    """Links are named by the skeleton's joints, fingertips ``index_tip`` and so on; the root: forearm."""
    robot = ElementTree.Element("robot", name=f"{skeleton.hand}_hand")
    _link(robot, ROOT)
    every = hinges(skeleton)
    for joint in skeleton.joints:
        parent, place, turned = joint.parent or ROOT, _metres(joint.offset_mm), _roll_pitch_yaw(joint)
        own = every[joint.name]
        for number, hinge in enumerate(own):
            is_last = number == len(own) - 1
            child = joint.name if is_last else f"{joint.name}_{hinge.rotation}_link"
            _link(robot, child, _length_m(skeleton, joint.name) if is_last else 0.0)
            made = ElementTree.SubElement(robot, "joint", name=hinge.name, type="revolute")
            _joined(made, parent, child, place, turned)
            ElementTree.SubElement(made, "axis", xyz=_numbers(joint.axis))
            low, high = (np.radians(bound) for bound in ACTIVE_RANGE_DEG[hinge.rotation])
            limit = {"lower": low, "upper": high, "effort": EFFORT_NM, "velocity": SPEED_RAD_S}
            ElementTree.SubElement(made, "limit", {name: f"{value:.9g}" for name, value in limit.items()})
            if hinge.mimics:
                ElementTree.SubElement(made, "mimic", joint=hinge.rotation, multiplier="1", offset="0")
            parent, place, turned = child, _NOTHING, _NOTHING
        if not own:
            _link(robot, joint.name)
            made = ElementTree.SubElement(robot, "joint", name=f"{joint.name}_fixed", type="fixed")
            _joined(made, parent, joint.name, place, turned)
    for tip in skeleton.tips:
        name = f"{FINGERS[tip.finger]}_tip"
        ElementTree.SubElement(robot, "link", name=name)
        made = ElementTree.SubElement(robot, "joint", name=f"{name}_fixed", type="fixed")
        _joined(made, tip.joint, name, _metres(tip.offset_mm), _NOTHING)
    return _text(robot)


def mjcf(skeleton: Skeleton) -> str:
    """Bodies are named by the skeleton's joints, fingertips are sites; what mimics is an equality."""
    root = ElementTree.Element("mujoco", model=f"{skeleton.hand}_hand")
    ElementTree.SubElement(root, "compiler", angle="radian", autolimits="true")
    world = ElementTree.SubElement(root, "worldbody")
    bodies: dict[str | None, ElementTree.Element] = {None: ElementTree.SubElement(world, "body", name=ROOT)}
    equal = ElementTree.Element("equality")
    every = hinges(skeleton)
    for joint in skeleton.joints:
        body = ElementTree.SubElement(
            bodies[joint.parent], "body", name=joint.name, pos=_metres(joint.offset_mm),
            quat=_numbers(joint.orientation),
        )  # fmt: skip
        bodies[joint.name] = body
        _weigh(body)
        for hinge in every[joint.name]:
            low, high = (np.radians(bound) for bound in ACTIVE_RANGE_DEG[hinge.rotation])
            ElementTree.SubElement(
                body, "joint", name=hinge.name, type="hinge", axis=_numbers(joint.axis),
                range=f"{low:.9g} {high:.9g}", armature=f"{ARMATURE:g}", damping=f"{DAMPING:g}",
            )  # fmt: skip
            if hinge.mimics:
                ElementTree.SubElement(
                    equal, "joint", joint1=hinge.name, joint2=hinge.rotation, polycoef="0 1 0 0 0"
                )
        length_m = _length_m(skeleton, joint.name)
        if length_m:
            ends = f"0 0 0 {length_m:.9g} 0 0"
            ElementTree.SubElement(
                body, "geom", type="capsule", size=f"{RADIUS_M:g}", fromto=ends, contype="0", conaffinity="0"
            )
    for tip in skeleton.tips:
        name = f"{FINGERS[tip.finger]}_tip"
        ElementTree.SubElement(bodies[tip.joint], "site", name=name, pos=_metres(tip.offset_mm))
    if len(equal):
        root.append(equal)
    return _text(root)


def _link(robot: ElementTree.Element, name: str, length_m: float = 0.0) -> None:
    link = ElementTree.SubElement(robot, "link", name=name)
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "mass", value=f"{MASS_KG:g}")
    axes: dict[str, str] = dict.fromkeys(("ixy", "ixz", "iyz"), "0")
    axes.update(dict.fromkeys(("ixx", "iyy", "izz"), f"{INERTIA:g}"))
    ElementTree.SubElement(inertial, "inertia", axes)
    if length_m:
        visual = ElementTree.SubElement(link, "visual")
        along = {"xyz": f"{length_m / 2:.9g} 0 0", "rpy": f"0 {np.pi / 2:.9g} 0"}
        ElementTree.SubElement(visual, "origin", along)
        geometry = ElementTree.SubElement(visual, "geometry")
        ElementTree.SubElement(geometry, "cylinder", radius=f"{RADIUS_M:g}", length=f"{length_m:.9g}")


def _joined(made: ElementTree.Element, parent: str, child: str, place: str, turned: str) -> None:
    ElementTree.SubElement(made, "origin", xyz=place, rpy=turned)
    ElementTree.SubElement(made, "parent", link=parent)
    ElementTree.SubElement(made, "child", link=child)


def _weigh(body: ElementTree.Element) -> None:
    inertia = " ".join([f"{INERTIA:g}"] * 3)
    ElementTree.SubElement(body, "inertial", pos=_NOTHING, mass=f"{MASS_KG:g}", diaginertia=inertia)


def _length_m(skeleton: Skeleton, joint: str) -> float:
    """From a joint to the next or to the fingertip, where that lies along its x."""
    ends = [each.offset_mm for each in skeleton.joints if each.parent == joint]
    ends += [tip.offset_mm for tip in skeleton.tips if tip.joint == joint]
    lengths = [x * M_PER_MM for x, y, z in ends if x > 0 and y == z == 0]
    return lengths[0] if lengths else 0.0


def _metres(offset_mm: tuple[float, float, float]) -> str:
    return _numbers([length * M_PER_MM for length in offset_mm])


def _numbers(values: Iterator[float] | tuple[float, ...] | list[float]) -> str:
    return " ".join(f"{value:.12g}" for value in values)


def _roll_pitch_yaw(joint: Joint) -> str:
    from scipy.spatial.transform import Rotation  # slow to load, and every command that exports loads this

    turned = Rotation.from_quat(joint.orientation, scalar_first=True)
    return _numbers(turned.as_euler("xyz").tolist())


def _text(root: ElementTree.Element) -> str:
    ElementTree.indent(root)
    return f'<?xml version="1.0"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'
