"""A take on a robot's hand: the subject's own hand as a robot gives back its angles; limits are held."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from characters import write_character
from posed_hands import moving

from glovecal_models.errors import BadInput
from glovecal_models.hand.bones import PHALANGES
from glovecal_models.hand.retargeting.robot import RobotHand
from glovecal_models.hand.retargeting.robot_description import KINDS
from glovecal_models.hand.retargeting.robot_retarget import RobotRetargeting
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, FINGERS, HANDS
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_service.exports.character_fit import CharacterFit
from glovecal_service.exports.onto import is_robot, read_onto
from glovecal_service.exports.robot_hand import urdf

OWN_LINKS = {"hand": "W_FLEX"} | {
    f"{finger}_{part}": joint
    for letter, finger in FINGERS.items()
    for part, joint in zip(
        PHALANGES[finger],
        ("T_VIR", "T_MCP", "T_IP") if letter == "T" else (f"{letter}_MCP", f"{letter}_PIP", f"{letter}_DIP"),
        strict=True,
    )
}
"""The links of a subject's hand as a robot, which have the names of its joints."""


@pytest.mark.parametrize("hand", HANDS)
def test_the_subjects_own_hand_as_a_robot_gives_its_angles_back(hand) -> None:
    skeleton = hand_skeleton(hand=hand)
    made = RobotRetargeting(skeleton, RobotHand.from_urdf(urdf(skeleton), "own", OWN_LINKS))
    assert made.units_a_mm == pytest.approx(1.0, abs=1e-3)
    low, high = np.array([ACTIVE_RANGE_DEG[name] for name in skeleton.rotations]).T
    angles = np.random.default_rng(6).uniform(low, high, (50, len(low)))
    own = dict(zip(skeleton.rotations, angles.T, strict=True))
    shown = dict(zip(made.robot.free, np.degrees(made.radians(angles)).T, strict=True))
    for name in ("I_MCP", "I_PIP", "I_DIP", "M_PIP", "R_MCP", "P_PIP", "P_DIP", "IM_ABD", "W_FLEX", "W_ABD"):
        assert np.abs(own[name] - shown[name]).max() < 0.5, name
    away = np.linalg.norm(made.own_joints_mm(angles) - made.shown_joints_mm(angles), axis=3)
    assert away.max() < 1.5, "mm: what the middle of the limits pulls is less than what one sees"


@pytest.mark.parametrize("kind", KINDS)
def test_how_well_a_robot_fits_is_told_and_its_limits_are_held(tmp_path: Path, kind: str) -> None:
    motion = moving("R", count=300)
    low, high = np.array([ACTIVE_RANGE_DEG[name] for name in motion.rotations]).T
    motion.degrees[:] = np.clip(motion.degrees, low, high)
    onto = read_onto(kind)
    fit = CharacterFit.of(motion, onto.shown(motion.skeleton, {}))
    assert fit.bones["index_proximal"] == "index_proximal"
    assert ("pinky_proximal" in fit.missing) == (kind != "shadow"), "Allegro and LEAP have three fingers"
    assert 1.0 < fit.fingertip_mm < 40.0
    assert "<polyline" in fit.picture
    motion.degrees[7] = np.nan
    onto.write([motion], "angles", tmp_path / "robot.csv", {})
    rows = list(csv.DictReader((tmp_path / "robot.csv").read_text().splitlines()))
    robot = RobotHand.known(f"{kind}_right")
    for name, limits in zip(robot.free, np.degrees(robot.limits), strict=True):
        column = [row[f"p.{name}"] for row in rows]
        assert column[7] in ("", "nan"), "where nothing is known of the hand, nothing is said of the robot"
        angles = np.array([float(each) for each in column if each not in ("", "nan")])
        assert limits[0] - 1e-6 <= angles.min() <= angles.max() <= limits[1] + 1e-6


def test_a_file_is_recognised_by_its_content(tmp_path: Path) -> None:
    write_character(tmp_path / "hero.bin", "mixamo")
    (tmp_path / "robot.bin").write_text(urdf(hand_skeleton()))
    assert not is_robot(tmp_path / "hero.bin")
    assert is_robot(tmp_path / "robot.bin")
    motion = moving("R", count=5)
    with pytest.raises(BadInput, match="add them to it as fixed links"):
        read_onto(tmp_path / "robot.bin").shown(motion.skeleton, {})
    read_onto(tmp_path / "robot.bin").shown(motion.skeleton, OWN_LINKS)


def test_what_a_robot_cannot_do_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="leap_right"):
        read_onto("leap").shown(hand_skeleton(hand="left"), {})
    with pytest.raises(BadInput, match=r"not as \.bvh"):
        read_onto("shadow").write([moving("R", count=5)], "angles", tmp_path / "robot.bvh", {})
    with pytest.raises(BadInput, match="shadow"):
        read_onto("shadwo")
    with pytest.raises(BadInput, match=r"no bone 'right\.index_middle'"):
        read_onto("shadow").shown(hand_skeleton(), {"right.index_middle": "rh_ffmiddle"})


def test_bones_of_a_character_are_chosen_for_one_hand_or_left_out(tmp_path: Path) -> None:
    write_character(tmp_path / "hero.glb", "mixamo")
    hero = read_onto(tmp_path / "hero.glb")
    chosen = {"right.index_proximal": "mixamorig:RightHandMiddle1", "pinky_distal": ""}
    right, left = (hero.shown(hand_skeleton(hand=hand), chosen) for hand in ("right", "left"))
    assert right.mapping["index_proximal"] == "mixamorig:RightHandMiddle1"
    assert left.mapping["index_proximal"] == "mixamorig:LeftHandIndex1"
    assert "pinky_distal" not in {**right.mapping, **left.mapping}
    with pytest.raises(BadInput, match="'Nothing', which is to be index_proximal"):
        hero.shown(hand_skeleton(), {"index_proximal": "Nothing"})
