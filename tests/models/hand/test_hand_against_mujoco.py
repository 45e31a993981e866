# pyright: reportAttributeAccessIssue=false
"""Our kinematics against MuJoCo's, which is built from nothing but the exported JSON."""

from __future__ import annotations

import json
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.forward_kinematics import forward_kinematics, tip_jacobian
from glovecal_models.hand.skeleton import hand_skeleton, skeleton_document


def model_from(document: dict[str, Any]) -> mujoco.MjModel:
    """One body a joint, one site a fingertip; lengths stay millimetres."""
    root = ElementTree.Element("mujoco")
    ElementTree.SubElement(root, "compiler", angle="radian", autolimits="false")
    bodies = {None: ElementTree.SubElement(root, "worldbody")}
    for joint in document["joints"]:
        body = ElementTree.SubElement(
            bodies[joint["parent"]],
            "body",
            name=joint["name"],
            pos=written(joint["offset"]),
            quat=written(joint["orientation"]),
        )
        ElementTree.SubElement(body, "inertial", pos="0 0 0", mass="1", diaginertia="1 1 1")
        ElementTree.SubElement(body, "joint", name=joint["name"], type="hinge", axis=written(joint["axis"]))
        bodies[joint["name"]] = body
    for tip in document["tips"]:
        ElementTree.SubElement(bodies[tip["joint"]], "site", name=tip["finger"], pos=written(tip["offset"]))
    return mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))


def written(numbers: list[float]) -> str:
    return " ".join(map(repr, numbers))


@pytest.mark.parametrize("hand", ["right", "left"])
def test_places_and_slopes_agree_with_mujoco(hand) -> None:
    measured = {"hand_length": 176.0, "hand_breadth": 85.0, "T_distal": 31.0, "P_metacarpal": 79.0}
    skeleton = hand_skeleton(HandDimensions.from_measured(measured), hand)
    document = json.loads(json.dumps(skeleton_document(skeleton)))
    model = model_from(document)
    data = mujoco.MjData(model)
    names = [rotation["name"] for rotation in document["rotations"]]
    weights = np.array(
        [[joint["rotations"].get(name, 0.0) for name in names] for joint in document["joints"]]
    )
    angles = np.random.default_rng(8).uniform(-180, 180, (40, len(names)))
    frames = forward_kinematics(skeleton, angles)
    slopes = tip_jacobian(skeleton, frames)
    for frame, row in enumerate(angles):
        data.qpos[:] = weights @ np.radians(row)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        np.testing.assert_allclose(frames.tips_mm[frame], data.site_xpos, atol=1e-9)
        np.testing.assert_allclose(frames.joints_mm[frame], data.xpos[1:], atol=1e-9)
        np.testing.assert_allclose(frames.orientations[frame], data.xmat[1:].reshape(-1, 3, 3), atol=1e-12)
        for tip in range(5):
            by_joint = np.zeros((3, model.nv))
            mujoco.mj_jacSite(model, data, by_joint, None, tip)
            np.testing.assert_allclose(slopes[frame, tip], np.radians(by_joint @ weights), atol=1e-9)


def test_the_document_says_all_that_a_viewer_needs() -> None:
    document = skeleton_document(hand_skeleton())
    assert document["format"] == "glovecal.skeleton.v1"
    assert (document["length_unit"], document["angle_unit"], document["hand"]) == ("mm", "deg", "right")
    rotations = {item["name"]: item for item in document["rotations"]}
    assert rotations["I_DIP"]["rule"] == {"I_PIP": pytest.approx(2 / 3)}
    assert rotations["I_MCP"] == {"name": "I_MCP", "low": -10.0, "high": 90.0, "rule": None, "rest": 25.0}
    assert [tip["finger"] for tip in document["tips"]] == ["thumb", "index", "middle", "ring", "pinky"]
    assert document["dimensions"]["measured"] == []
    seen: set[str | None] = {None}
    for joint in document["joints"]:
        assert joint["parent"] in seen
        assert set(joint["rotations"]) <= set(rotations)
        seen.add(joint["name"])
