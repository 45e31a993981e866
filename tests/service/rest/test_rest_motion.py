"""Takes as motion files over REST and the command line: the active model, two hands, what is refused."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
import trc

sys.path.insert(0, str(Path(__file__).parents[1] / "exports"))

from characters import write_character, write_fbx_character

from glovecal_client.rest import Refused, RestClient
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_service.exports.marker_tables import trc_text
from glovecal_service.exports.robot_hand import robot_hand

Write = Callable[..., Path]


@pytest.fixture
def client(client: RestClient, write_table: Write) -> RestClient:
    for subject, hand, seed in (("anna", "right", 0), ("ben", "left", 1)):
        client.post("/subjects", {"name": subject, "hand": hand})
        client.upload_takes(write_table(f"{subject}.csv", (subject,), seed=seed), subject=subject)
    return client


def takes(client: RestClient) -> list[str]:
    return [take["id"] for take in client.get("/takes")]


def read(content: bytes, folder: Path) -> trc.TRCData:
    path = folder / "read.trc"
    path.write_bytes(content)
    data = trc.TRCData()
    data.load(str(path))
    return data


def test_raw_readings_of_both_hands(client: RestClient, tmp_path: Path) -> None:
    data = read(client.made("/motion", {"takes": takes(client), "content": "raw"}), tmp_path)
    assert data["Markers"] == ["R_index", "L_index"]
    assert data["NumFrames"] == 120
    exported = client.download(f"/takes/{takes(client)[0]}/export").decode().splitlines()
    names = exported[0].split(",")
    first = dict(zip(names, exported[1].split(","), strict=True))
    assert data["R_index"][0][1:] == [float(first["s.I_MCP"]), float(first["s.I_PIP"])]


def test_angles_are_those_of_the_active_model(client: RestClient, tmp_path: Path) -> None:
    right, left = takes(client)
    with pytest.raises(Refused, match=r"no model of anna .* is active") as refused:
        client.made("/motion", {"takes": [right]})
    assert refused.value.status == 409
    job = client.post("/models/train", {"subject": "anna", "method": "linear"})
    model = client.wait_for_job(job["id"], patience_s=300)["result"]["model"]
    series = client.post(f"/models/{model}/series", {"takes": [right], "rotation": "I_MCP", "points": 4000})[
        "takes"
    ][0]
    body = {"takes": [right], "content": "angles"}
    for named in ([], [None], [model[:10]]):
        data = read(client.made("/motion", {**body, "models": named}), tmp_path)
        written = np.array(data["R_index"])[:, 1]
        np.testing.assert_allclose(written, series["predicted_deg"], atol=1e-9)
    offline = np.array(read(client.made("/motion", body | {"offline": True}), tmp_path)["R_index"])[:, 1]
    live = np.array(data["R_index"])[:, 1]
    assert np.abs(np.diff(offline, 2)).sum() < np.abs(np.diff(live, 2)).sum()
    for other in ({"measured": True}, {"content": "raw"}):
        with pytest.raises(Refused, match="only a model's angles are estimated offline"):
            client.made("/motion", body | other | {"offline": True})
    joints = read(client.made("/motion", {"takes": [right]}), tmp_path)
    assert len(joints["Markers"]) == 21
    with pytest.raises(Refused, match="no model of ben"):
        client.made("/motion", {"takes": [right, left]})


@pytest.mark.parametrize(
    ("changed", "status", "why"),
    [
        ({"takes": ["nothing"]}, 404, "no take"),
        ({"takes": []}, 422, "takes"),
        ({"models": ["0123456789"]}, 422, "1 models for 2 takes"),
        ({"shifts_s": [0.0, 1e6]}, 422, "no moment in common"),
        ({"format": "stl"}, 422, "format"),
        ({"format": "glb"}, 422, r"\.glb cannot hold raw"),
        ({"content": "wrist"}, 422, "content"),
    ],
)
def test_what_cannot_be_written_is_said(client: RestClient, changed: dict, status: int, why: str) -> None:
    with pytest.raises(Refused, match=why) as refused:
        client.made("/motion", {"takes": takes(client), "content": "raw", **changed})
    assert refused.value.status == status


def test_measured_angles_need_no_model_and_may_have_another_rate(client: RestClient, tmp_path: Path) -> None:
    [right, _] = takes(client)
    body = {"takes": [right], "content": "angles", "measured": True}
    measured = read(client.made("/motion", body), tmp_path)
    slower = read(client.made("/motion", body | {"rate_hz": 50.0}), tmp_path)
    assert slower["NumFrames"] == measured["NumFrames"] // 2
    every = np.array(measured["R_index"])[::2, 1]
    np.testing.assert_allclose(np.array(slower["R_index"])[:, 1], every, atol=1e-9)
    smooth = read(client.made("/motion", body | {"low_pass_hz": 5.0}), tmp_path)
    roughness = [np.abs(np.diff(np.array(each["R_index"])[:, 1], 2)).sum() for each in (measured, smooth)]
    assert roughness[1] < 0.5 * roughness[0]
    with pytest.raises(Refused, match=r"30 Hz is too high for 50 frames a second; give at most 22.5 Hz"):
        client.made("/motion", body | {"rate_hz": 50.0, "low_pass_hz": 30.0})


def test_a_files_notes_tell_take_model_and_time_code(client: RestClient, tmp_path: Path) -> None:
    [right, _] = takes(client)
    client.put(f"/takes/{right}/time-code", {"time_code": "10:00:00:00", "rate": "25", "at_s": 0.0})
    body = {"takes": [right], "measured": True, "format": "glb", "rate_hz": 25.0}
    (tmp_path / "a.glb").write_bytes(client.made("/motion", body))
    document: Any = pygltflib.GLTF2.load_binary(str(tmp_path / "a.glb"))
    notes = document.asset.extras["right"]
    assert notes["take"] == "anna"
    assert notes["measured"]
    assert notes["model"] is None
    assert (notes["time_code"], notes["time_code_rate"], notes["rate_hz"]) == ("10:00:00:00", "25", 25.0)


def test_a_character_is_told_of_and_moved(client: RestClient, tmp_path: Path) -> None:
    [right, _] = takes(client)
    write_character(tmp_path / "hero.glb", "unreal")
    body = {"takes": [right], "measured": True, "format": "glb"}
    with pytest.raises(Refused, match="neither a character nor a robot is named") as refused:
        client.post("/motion/character", body)
    assert refused.value.status == 422
    with pytest.raises(Refused, match=r"no upload 0{12}; send the character's or robot's file") as refused:
        client.post("/motion/character", body | {"onto": "0" * 64})
    assert refused.value.status == 404
    body |= {"onto": client.upload(tmp_path / "hero.glb")}
    [fit] = client.post("/motion/character", body)
    assert fit["bones"]["index_proximal"] == "index_01_r"
    assert fit["hand"] == "right"
    (tmp_path / "moved.glb").write_bytes(client.made("/motion", body))
    document: Any = pygltflib.GLTF2.load_binary(str(tmp_path / "moved.glb"))
    moved = {document.nodes[channel.target.node].name for channel in document.animations[0].channels}
    assert "index_01_r" in moved
    with pytest.raises(Refused, match=r"this character moves in a \.glb file, not in \.fbx"):
        client.made("/motion", body | {"format": "fbx"})
    write_fbx_character(tmp_path / "hero.fbx", "mixamo")
    body |= {"onto": client.upload(tmp_path / "hero.fbx"), "format": "fbx"}
    [fit] = client.post("/motion/character", body)
    assert fit["bones"]["index_proximal"] == "mixamorig:RightHandIndex1"
    assert b"Glovecal take" in client.made("/motion", body)
    other = client.upload(write_nothing(tmp_path))
    with pytest.raises(Refused, match="does not begin as glTF does"):
        client.post("/motion/character", body | {"onto": other})


def test_a_robots_joints_are_told_of_and_written(client: RestClient, tmp_path: Path) -> None:
    [right, _] = takes(client)
    body = {"takes": [right], "measured": True, "format": "csv", "onto": "allegro"}
    [fit] = client.post("/motion/character", body)
    assert fit["missing"] == ["pinky_proximal", "pinky_intermediate", "pinky_distal"]
    assert "ff_proximal" in fit["choices"]
    head = client.made("/motion", body).decode().splitlines()[0].split(",")
    assert {"r.ffj0", "r.thj3"} <= set(head)
    (tmp_path / "own.urdf").write_text(robot_hand(hand_skeleton(), "urdf"))
    body |= {"onto": client.upload(tmp_path / "own.urdf"), "format": "parquet"}
    with pytest.raises(Refused, match="add them to it as fixed links") as refused:
        client.made("/motion", body)
    assert refused.value.status == 422
    joints = {"proximal": "MCP", "intermediate": "PIP", "distal": "DIP"}
    links = {
        f"{finger}_{part}": f"{finger[0].upper()}_{joint}"
        for finger in ("index", "middle") for part, joint in joints.items()
    }  # fmt: skip
    assert client.made("/motion", body | {"bones": {"hand": "W_FLEX", **links}})[:4] == b"PAR1"
    with pytest.raises(Refused, match="no bone 'thumb_toe'"):
        client.made("/motion", body | {"bones": {"thumb_toe": "T_IP"}})
    with pytest.raises(Refused, match="nothing onto which"):
        client.made("/motion", body | {"onto": None, "bones": links})


def write_nothing(folder: Path) -> Path:
    path = folder / "no.glb"
    path.write_text("this is no character")
    return path


def test_two_takes_of_one_hand_are_no_pair(client: RestClient) -> None:
    take = takes(client)[0]
    with pytest.raises(Refused, match="of the same hand"):
        client.made("/motion", {"takes": [take, take], "content": "raw"})


def test_a_hand_that_nobody_said_is_asked_for(client: RestClient, write_table: Write, tmp_path: Path) -> None:
    client.post("/subjects", {"name": "kira"})
    assert client.get("/subjects/kira")["hand"] == "unknown"
    client.upload_takes(write_table("kira.csv", ("kira",), seed=2), subject="kira")
    [take] = [row["id"] for row in client.get("/takes", {"subject": "kira"})]
    body = {"takes": [take], "content": "raw"}
    with pytest.raises(
        Refused, match=r"nobody said which hand take \w+ is of: name it with --hand"
    ) as refused:
        client.made("/motion", body)
    assert refused.value.status == 409
    said = read(client.made("/motion", body | {"hands": ["left"]}), tmp_path)
    assert said["Markers"] == ["L_index"]
    client.put("/subjects/kira/hand", {"dimensions": {}, "hand": "left"})
    assert read(client.made("/motion", body), tmp_path)["Markers"] == ["L_index"]


def test_hands_of_imported_tables_are_joined_as_they_are_and_said_so(client: RestClient) -> None:
    found = client.post("/takes/hands", {"takes": takes(client)})
    assert (found["how"], found["shift_s"], found["sd_s"]) == ("assumed", 0, None)
    assert "Record a clap" in found["sentence"]
    with pytest.raises(Refused, match=r"clap"):
        client.post("/takes/hands", {"takes": takes(client), "claps": True})


def test_markers_of_a_body_are_joined_to_the_joints(client: RestClient, tmp_path: Path) -> None:
    right = takes(client)[0]
    job = client.post("/models/train", {"subject": "anna", "method": "linear"})
    client.wait_for_job(job["id"], patience_s=300)
    time_s = np.arange(300) / 200
    arm = {"RAD": (0.0, 30.0, 0.0), "ULN": (0.0, -30.0, 0.0), "ELB": (-250.0, 0.0, 0.0)}
    places = {name: np.tile(place, (300, 1)) + np.array([0.0, 0.0, 900.0]) for name, place in arm.items()}
    (tmp_path / "body.trc").write_text(trc_text(time_s, places, "body.trc"))
    body = {"upload": client.upload(tmp_path / "body.trc"), "right": list(arm)}
    asked = {"takes": [right], "body": body, "format": "trc"}
    data = read(client.made("/motion", asked), tmp_path)
    assert set(arm) < set(data["Markers"])
    np.testing.assert_allclose(data["R_wrist"], np.tile([0.0, 0.0, 900.0], (120, 1)), atol=1e-6)
    np.testing.assert_allclose(data["ELB"][:100], places["ELB"][:100], atol=1e-6)
    with pytest.raises(Refused, match="joined to joints in a TRC file"):
        client.made("/motion", {**asked, "content": "raw"})
    with pytest.raises(Refused, match="no upload"):
        client.made("/motion", {**asked, "body": {"upload": "0" * 64}})
