"""What the Blender extension works out beside Blender: turns as quaternions, and which bone is how certain.

In Blender itself: ``python3 do.py blender --test``.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from glovecal_models.hand.bones import HandBones
from glovecal_models.hand.skeleton import hand_skeleton

SOURCE = Path(__file__).resolve().parents[2] / "client" / "blender" / "glovecal_blender" / "live_hand.py"


@pytest.fixture(scope="module")
def live_hand() -> ModuleType:
    """Without its package, which needs Blender."""
    spec = importlib.util.spec_from_file_location("blender_live_hand", SOURCE)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_turns_are_read_as_quaternions_whatever_they_are(live_hand: ModuleType) -> None:
    random = Rotation.random(500, rng=np.random.default_rng(4))
    half_turns = Rotation.from_rotvec(np.pi * np.concatenate([np.eye(3), -np.eye(3)]))
    whole = Rotation.concatenate([random, half_turns, Rotation.identity(1)])
    given = live_hand.quaternions(whole.as_matrix())
    back = Rotation.from_quat(given, scalar_first=True)
    assert np.degrees((back.inv() * whole).magnitude()).max() < 1e-6


def test_a_bone_is_as_certain_as_what_turns_it(live_hand: ModuleType) -> None:
    skeleton = hand_skeleton(palm="arching")
    bones = HandBones.of(skeleton)
    turned_by = {
        name: {skeleton.rotations[at] for at in np.flatnonzero(row)}
        for name, row in zip(bones.names, live_hand.rotations_of(bones), strict=True)
    }
    assert turned_by["hand"] == {"W_FLEX", "W_ABD"}
    assert turned_by["index_proximal"] == {"I_MCP", "IM_ABD"}
    assert turned_by["index_distal"] == {"I_DIP"}
    assert turned_by["thumb_metacarpal"] == {"T_TMC", "TI_ABD", "T_VIR"}
    assert turned_by["pinky_metacarpal"] == {"PALM_ARCH"}
    assert turned_by["pinky_proximal"] == {"P_MCP", "MR_ABD", "RP_ABD"}
