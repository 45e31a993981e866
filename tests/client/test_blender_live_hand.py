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

sys.path.insert(0, str(Path(__file__).parents[1] / "service"))
sys.path.insert(0, str(Path(__file__).parents[1] / "service" / "cli"))
sys.path.insert(0, str(Path(__file__).parents[1] / "service" / "bridges"))
sys.path.insert(0, str(Path(__file__).parents[1] / "models" / "retargeting"))

from bridge_support import FLAT, SITE, open_stage
from realtime_support import eventually
from rigs import CONVENTIONS, rig_like

from glovecal_client.session import open_client
from glovecal_client.wire.pose import RotationFlag
from glovecal_models.hand.bones import HandBones
from glovecal_models.hand.retargeting.retarget import Retargeting
from glovecal_models.hand.retargeting.touches import Touches
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


def test_no_bone_of_a_glove_that_cannot_be_trusted_looks_live(live_hand: ModuleType) -> None:
    unsure = {"I_PIP": int(RotationFlag.TOO_UNCERTAIN)}
    with open_stage() as stage, open_client([stage.endpoint]) as session:
        stage.show(right={"angles": FLAT, "rotation_flags": unsure})
        hand = live_hand.LiveHand(session, SITE, stage.right.glove)
        try:
            skeleton = eventually(lambda: hand.skeleton, "the hand's skeleton")
            rig = rig_like(CONVENTIONS["rigify"], "right")
            hand.follow(Touches(Retargeting.of(skeleton, rig)))
            latest = eventually(lambda: hand.latest, "a pose")
            usable = dict(zip(hand.names, latest.usable.tolist(), strict=True))
            assert not usable["f_index.02.R"]
            assert usable["f_index.01.R"]
            stage.show(right=None)
            eventually(lambda: not hand.latest.usable.any(), "no bone looks live in silence")
            assert "Stale" in hand.sentence
        finally:
            hand.close()


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
