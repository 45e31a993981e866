"""BVH files hold against an independent reader (pybvh): its joints are where our kinematics put them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pybvh
import pytest

from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import ARCHING_ROTATIONS, FINGERS, HAND_ROTATIONS
from glovecal_models.hand.skeleton import Palm, hand_skeleton
from glovecal_service.exports.body_markers import HandFrame
from glovecal_service.exports.body_motion import PALM_DOWN, SIDES
from glovecal_service.exports.formats import FORMATS
from glovecal_service.exports.hand_motion import HandMotion

WRITE = FORMATS[".bvh"].write
AGREES_MM = 1e-3
BONES = {"T_MCP": "Thumb2", "T_IP": "Thumb3", "I_PIP": "Index2", "R_DIP": "Ring3", "P_MCP": "Pinky1"}


def moving(label: str = "R", palm: Palm = "rigid", count: int = 12) -> HandMotion:
    dimensions = HandDimensions.from_measured({"hand_length": 178.0 if label == "L" else 190.0})
    skeleton = hand_skeleton(dimensions, "left" if label == "L" else "right", palm)
    time_s = 3.0 + np.arange(count) / 60.0
    phase = np.arange(len(skeleton.rotations)) + (label == "L")
    degrees = 35 + 45 * np.sin(9 * time_s[:, None] + phase)
    nothing = np.empty((count, 0))
    return HandMotion(
        label, time_s, (), nothing, skeleton.rotations, degrees, np.ones_like(degrees), skeleton
    )  # fmt: skip


def read(path: Path, frame: int) -> dict[str, np.ndarray]:
    """(3,) mm of every joint and end as pybvh's own kinematics finds them."""
    motion = pybvh.Bvh.from_file(path)
    places = 10 * motion.node_positions(frame)
    names = [
        f"{node.parent.name}_End" if node.parent and node.is_end_site() else node.name
        for node in motion.nodes
    ]
    return dict(zip(names, places, strict=True))


@pytest.mark.parametrize("palm", ["rigid", "arching"])
def test_another_reader_finds_every_joint_of_both_hands(tmp_path: Path, palm) -> None:
    hands = [moving("R", palm), moving("L", palm)]
    assert hands[0].rotations == (ARCHING_ROTATIONS if palm == "arching" else HAND_ROTATIONS)
    WRITE(hands, "joints", tmp_path / "both.bvh")
    for frame in (0, 5, 11):
        found = read(tmp_path / "both.bvh", frame)
        for hand in hands:
            side, frames = SIDES[hand.label], forward_kinematics(hand.skeleton, hand.degrees[[frame]])
            names = [joint.name for joint in hand.skeleton.joints]
            for joint, bone in BONES.items():
                ours = PALM_DOWN[hand.label] @ frames.joints_mm[0, names.index(joint)]
                theirs = found[f"{side}Hand{bone}"] - found[f"{side}Hand"]
                assert np.abs(ours - theirs).max() < AGREES_MM, (frame, joint)
            for tip, place in zip(hand.skeleton.tips, frames.tips_mm[0], strict=True):
                end = found[f"{side}Hand{FINGERS[tip.finger].capitalize()}3_End"]
                assert np.abs(PALM_DOWN[hand.label] @ place - (end - found[f"{side}Hand"])).max() < AGREES_MM


def test_the_body_stands_with_its_arms_out(tmp_path: Path) -> None:
    WRITE([moving("R")], "angles", tmp_path / "one.bvh")
    found = read(tmp_path / "one.bvh", 0)
    assert found["RightHand"][0] < -600 < 600 < found["LeftHand"][0]
    np.testing.assert_allclose(found["RightHand"][1:], found["RightArm"][1:], atol=1e-3)
    assert found["Head"][1] > found["Hips"][1] > found["LeftFoot"][1] > 0
    straight = found["LeftHandMiddle3_End"] - found["LeftHandMiddle1"]
    assert straight[0] == pytest.approx(np.linalg.norm(straight), abs=1e-6), "the other hand is at rest"


def test_steps_are_even_and_a_lost_angle_stays_as_it_was(tmp_path: Path) -> None:
    hand = moving(count=12)
    kept = [0, 1, 2, 3, 5, 6, 7, 8, 9, 10, 11]
    degrees = hand.degrees.copy()
    degrees[6:, 3] = np.nan
    readings, degrees = hand.readings[kept], degrees[kept]
    gappy = replace(hand, time_s=hand.time_s[kept], degrees=degrees, sd_deg=degrees, readings=readings)
    WRITE([gappy], "joints", tmp_path / "gap.bvh")
    text = (tmp_path / "gap.bvh").read_text()
    assert "Frames: 12\nFrame Time: 0.016666667\n" in text
    rows = np.loadtxt(text.split("Frame Time")[1].splitlines()[1:])
    assert np.isfinite(rows).all()
    assert (np.ptp(rows[5:], axis=0) == 0).sum() > (np.ptp(rows[:5], axis=0) == 0).sum()


def test_frames_stand_where_the_header_says(tmp_path: Path) -> None:
    """Steps of a glove that runs at its own rate: their median is not their mean."""
    steps = np.where(np.arange(1400) % 4, 0.0166, 0.0169)
    time_s = 1.7e9 + np.concatenate([[0.0], np.cumsum(steps)])
    turning = moving(count=len(time_s))
    degrees = np.zeros_like(turning.degrees)
    degrees[:, turning.rotations.index("I_PIP")] = 60 * (time_s - time_s[0]) / (time_s[-1] - time_s[0])
    WRITE([replace(turning, time_s=time_s, degrees=degrees)], "joints", tmp_path / "own-rate.bvh")
    text = (tmp_path / "own-rate.bvh").read_text()
    header, _, rows = text.partition("Frame Time: ")
    step_s, frames = float(rows.splitlines()[0]), np.loadtxt(rows.splitlines()[1:])
    told_s = step_s * np.arange(len(frames))
    moved = frames[:, np.abs(frames[-1] - frames[0]).argmax()]
    expected = np.interp(told_s, time_s - time_s[0], 60 * (time_s - time_s[0]) / (time_s[-1] - time_s[0]))
    late_s = (np.abs(moved) - expected) / 60 * (time_s[-1] - time_s[0])
    assert f"Frames: {len(frames)}\n" in header
    assert np.abs(late_s).max() < 0.5e-3


def test_what_no_person_did_is_marked(tmp_path: Path) -> None:
    WRITE([replace(moving(), simulated=True)], "joints", tmp_path / "made.bvh")
    assert "JOINT SimulatedGlove" in (tmp_path / "made.bvh").read_text()
    WRITE([moving()], "joints", tmp_path / "real.bvh")
    assert "Simulated" not in (tmp_path / "real.bvh").read_text()


def test_what_it_cannot_hold_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "no.bvh"
    with pytest.raises(BadInput, match="1 frames are no motion"):
        WRITE([moving(count=1)], "joints", path)
    placed = replace(moving(), frame=HandFrame(np.zeros((12, 3)), np.tile(np.eye(3), (12, 1, 1))))
    with pytest.raises(BadInput, match="body at rest"):
        WRITE([placed], "joints", path)
    assert not path.exists()
