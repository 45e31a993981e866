"""Motion files of other systems as reference angles: ours read back, other names, wild files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, HAND_ROTATIONS, HANDS, Handedness
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_service.exports.formats import FORMATS
from glovecal_service.exports.hand_motion import HandMotion
from glovecal_service.exports.motion_files.angles_of_points import named_points
from glovecal_service.exports.motion_files.formats import motion_format
from glovecal_service.exports.motion_files.reference_file import read_reference_file

FRAMES = 120
WRIST = ("W_FLEX", "W_ABD")
TOLD = tuple(name for name in HAND_ROTATIONS if name not in ("T_TMC", "TI_ABD", "T_VIR"))
"""By places: the thumb's own turns are not."""


def moving_hand(hand: Handedness) -> HandMotion:
    """Every joint in its whole range, each in its own time."""
    rng = np.random.default_rng(5)
    skeleton = hand_skeleton(hand=hand)
    low, high = np.array([ACTIVE_RANGE_DEG[name] for name in skeleton.rotations]).T
    time_s = np.arange(FRAMES) / 60.0
    turns = rng.uniform(0.5, 2.0, len(low)) * time_s[:, None] + rng.uniform(0.0, 1.0, len(low))
    degrees = low + (high - low) * (0.5 + 0.45 * np.sin(2 * np.pi * turns))
    return HandMotion(
        hand[0].upper(), time_s, ("none",), np.zeros((FRAMES, 1)), skeleton.rotations, degrees,
        np.ones_like(degrees), skeleton,
    )  # fmt: skip


def written(folder: Path, suffix: str, hand: Handedness) -> Path:
    path = folder / f"seen{suffix}"
    FORMATS[suffix].write([moving_hand(hand)], "joints", path)
    return path


@pytest.mark.parametrize("suffix", [".trc", ".bvh"])
@pytest.mark.parametrize("hand", HANDS)
def test_places_tell_the_angles_that_they_were_made_of(tmp_path: Path, suffix: str, hand: Handedness) -> None:
    found = read_reference_file(written(tmp_path, suffix, hand))
    assert found.hand == hand, "of two hands the one that moves"
    motion, rows = moving_hand(hand), found.rows[None]
    expected = set(TOLD) - (set(WRIST) if suffix == ".trc" else set())
    assert set(rows.rotations) == expected
    assert rows.time_s == pytest.approx(motion.time_s, abs=1e-6)
    for name, angles in zip(rows.rotations, rows.reference.T, strict=True):
        truth = motion.degrees[:, motion.rotations.index(name)]
        seen = np.isfinite(angles)
        assert angles[seen] == pytest.approx(truth[seen], abs=0.05)
        assert seen.all() or name.endswith("ABD"), "a spread is not seen in a fist"


def test_the_other_hand_is_told(tmp_path: Path) -> None:
    path = written(tmp_path, ".trc", "left")
    path.write_text(path.read_text().replace("L_", ""))
    assert read_reference_file(path).hand == "left", "fingers bend to the palm"
    wrong = read_reference_file(path, None, "right")
    assert "The fingers bend backwards: is it the other hand?" in wrong.odd


@pytest.mark.parametrize(
    ("name", "hand", "joint"),
    [
        ("RightHandIndex1", "right", "I_MCP"), ("LeftHandThumb3", "left", "T_IP"),
        ("mixamorig:LeftHandPinky4", "left", "P_TIP"), ("RIndex2", "right", "I_PIP"),
        ("Left Ring Intermediate", "left", "R_PIP"), ("right_middle_distal", "right", "M_DIP"),
        ("Right Thumb Proximal", "right", "T_CMC"), ("RightHandIndex3 end", "right", "I_TIP"),
        ("RightHand", "right", "WRIST"), ("LeftForeArm", "left", "ELBOW"), ("wrist", None, "WRIST"),
    ],
)  # fmt: skip
def test_names_of_other_programs(name: str, hand: Handedness | None, joint: str) -> None:
    point = named_points([name])[name]
    assert (point.hand, point.joint) == (hand, joint)


def test_names_that_are_of_no_hand() -> None:
    assert (
        named_points(["LASI", "Hips", "Head", "LeftUpLeg", "RightToeBase", "Spine1", "RightHandIndex9"]) == {}
    )


def test_a_thumb_whose_metacarpal_has_a_name_of_its_own() -> None:
    points = named_points(["thumb_metacarpal", "thumb_proximal", "thumb_distal", "thumb_tip"])
    assert [point.joint for point in points.values()] == ["T_CMC", "T_MCP", "T_IP", "T_TIP"]


def _small(path: Path) -> bytes:
    """A few frames are enough to be damaged."""
    lines = path.read_bytes().splitlines(keepends=True)
    return b"".join(lines[: len(lines) - FRAMES + 4]).replace(b"Frames: 120", b"Frames: 4")


@pytest.mark.parametrize("suffix", [".trc", ".bvh"])
@given(data=st.data())
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_damaged_file_gives_angles_or_a_sentence(tmp_path: Path, suffix: str, data: st.DataObject) -> None:
    content = _small(written(tmp_path, suffix, "right"))
    at = data.draw(st.integers(20, len(content) - 1))
    cut = data.draw(st.sampled_from([0, 1, 7, len(content)]))
    wild = data.draw(
        st.binary(max_size=8) | st.sampled_from([b"nan", b"1e400", b"{", b"}\n", b"\t\t", b"\0"])
    )
    path = tmp_path / f"damaged{suffix}"
    path.write_bytes(content[:at] + wild + content[at + cut :])
    assert motion_format(path) is not None, "recognised by how it begins"
    try:
        found = read_reference_file(path)
    except BadInput:
        return
    assert found.rows[None].reference.shape == (len(found.rows[None].time_s), len(found.rows[None].rotations))
