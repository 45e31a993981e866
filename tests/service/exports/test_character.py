"""A take on a character of another program: its file, read by another reader, has the hand's motion."""

from __future__ import annotations

import json
import struct
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parent))

from characters import write_character
from posed_hands import RATE_HZ, moving
from rigs import CONVENTIONS, TO_WORLD
from test_skeleton_formats import read_glb

from glovecal_models.errors import BadInput
from glovecal_models.hand.bones import HandBones
from glovecal_models.hand.retargeting.rig import hand_of
from glovecal_service.exports.character_fit import CharacterFit
from glovecal_service.exports.gltf_character import GltfCharacter


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_its_bones_point_where_the_hands_point(tmp_path: Path, convention: str) -> None:
    write_character(tmp_path / "character.glb", convention)
    character = GltfCharacter.read(tmp_path / "character.glb", "character.glb")
    hands = [moving("R"), moving("L")]
    for hand in hands:  # a thumb that touches nothing: near a touch joints are turned further
        hand.degrees[:] = np.clip(hand.degrees, 0, 40)
        for name, angle in {"T_TMC": 0.0, "TI_ABD": 65.0, "T_MCP": 0.0, "T_IP": 0.0}.items():
            hand.degrees[:, hand.rotations.index(name)] = angle
    character.write(hands, "joints", tmp_path / "moved.glb", {})
    assert b"what was there before" in (tmp_path / "moved.glb").read_bytes()
    for frame in (0, 7):
        places = read_glb(tmp_path / "moved.glb", frame / RATE_HZ)
        for hand in hands:
            side = hand.skeleton.hand
            mapping, bones = hand_of(character.rig, side), HandBones.of(hand.skeleton)
            axes = bones.orientations(hand.degrees[[frame]])[0]
            for finger in ("index", "middle", "ring", "pinky", "thumb"):
                parts = ("metacarpal", "proximal") if finger == "thumb" else ("proximal", "intermediate")
                first, second = (mapping[f"{finger}_{part}"] for part in parts)
                along = places[second] - places[first]
                wanted = TO_WORLD[side] @ axes[bones.names.index(f"{finger}_{parts[0]}"), :, 0]
                cross = np.linalg.norm(np.cross(along, wanted)) / np.linalg.norm(along)
                assert np.degrees(cross) < 1e-3, (side, finger, frame)
                assert along @ wanted > 0


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_how_well_it_fits_is_told(tmp_path: Path, convention: str) -> None:
    write_character(tmp_path / "character.glb", convention)
    character = GltfCharacter.read(tmp_path / "character.glb", "character.glb")
    motion = moving("L", count=800)
    fit = CharacterFit.of(motion, character.shown(motion.skeleton, {}))
    assert fit.bones["index_proximal"] == hand_of(character.rig, "left")["index_proximal"]
    assert fit.missing == ()
    assert 0.5 < fit.fingertip_mm < 20.0
    assert fit.lost == 0
    assert fit.touches > 0
    assert fit.picture.count("<polyline") == 2 * 3 * 5


def test_a_character_of_the_hands_own_size_is_exact(tmp_path: Path) -> None:
    from glovecal_service.exports.formats import FORMATS

    motion = moving("R", count=50)
    FORMATS[".glb"].write([motion], "joints", tmp_path / "own.glb")
    fit = CharacterFit.of(
        motion, GltfCharacter.read(tmp_path / "own.glb", "own.glb").shown(motion.skeleton, {})
    )
    assert fit.fingertip_mm < 0.05
    assert fit.lost == 0


def test_a_node_given_as_a_matrix_is_animated_all_the_same(tmp_path: Path) -> None:
    write_character(tmp_path / "plain.glb", "mixamo")
    plain = GltfCharacter.read(tmp_path / "plain.glb", "plain.glb")
    number = plain.names.index("mixamorig:RightHandIndex1")
    document = json.loads(json.dumps(plain.document))
    node = document["nodes"][number]
    bone = plain.rig.by_name["mixamorig:RightHandIndex1"]
    hand = plain.rig.by_name["mixamorig:RightHand"]
    matrix = np.eye(4)
    matrix[:3, :3] = hand.orientation.T @ bone.orientation
    matrix[:3, 3] = node.pop("translation")
    del node["rotation"]
    node["matrix"] = matrix.T.reshape(-1).tolist()
    given_as_matrix = replace(plain, document=document)
    motion = moving("R")
    for name, character in (("a", plain), ("b", given_as_matrix)):
        character.write([motion], "joints", tmp_path / f"{name}.glb", {})
    first, second = (read_glb(tmp_path / f"{name}.glb", 5 / RATE_HZ) for name in "ab")
    for name, place in first.items():
        np.testing.assert_allclose(second[name], place, atol=1e-3)


def container(document: object) -> bytes:
    text = json.dumps(document).encode()
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text)) + struct.pack("<I4s", len(text), b"JSON")
    return head + text + struct.pack("<I4s", 0, b"BIN\x00")


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "does not begin as glTF does"),
        (b"glTF" + bytes(40), "no description of its scene"),
        (container([]), "describes no scene"),
        (container({}), "has no nodes"),
        (container({"nodes": [{"children": [0]}]}), "no left hand was found"),
        (container({"nodes": [{"children": [1]}, {"children": [1]}]}), "not as glTF has them"),
        (container({"nodes": [{"rotation": [1, 2]}]}), "not as glTF has them"),
        (container({"nodes": [{"name": "hips"}]}), "no left hand was found among 1 bones"),
    ],
)
def test_what_is_no_character_is_refused(tmp_path: Path, content: bytes, why: str) -> None:
    (tmp_path / "odd.glb").write_bytes(content)
    with pytest.raises(BadInput, match=why):
        GltfCharacter.read(tmp_path / "odd.glb", "odd.glb").write(
            [moving("L")], "joints", tmp_path / "out.glb", {}
        )


KEYS = ("nodes", "name", "children", "rotation", "matrix", "scale", "translation")
json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers(-5, 9) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(KEYS), inner, max_size=4),
)


@given(document=st.fixed_dictionaries({"nodes": st.lists(json_values, max_size=5)}))
def test_whatever_nodes_are_they_are_a_rig_or_refused(tmp_path_factory, document) -> None:
    path = tmp_path_factory.mktemp("wild") / "wild.glb"
    path.write_bytes(container(document))
    refused = ""
    try:
        bones = GltfCharacter.read(path, "wild.glb").rig.bones
    except BadInput as error:
        refused = str(error)
    else:
        assert len(bones) <= len(document["nodes"])
    assert not refused or "glTF" in refused or "wild.glb" in refused
