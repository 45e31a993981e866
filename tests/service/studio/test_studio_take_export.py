"""A take's motion as a file, from its page: what the browser saves is what another program reads."""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
from playwright.sync_api import expect

sys.path.insert(0, str(Path(__file__).parents[1] / "exports"))

from characters import write_character, write_fbx_character
from studio_support import PATIENCE_MS, Open, serious

from glovecal_client.rest import RestClient
from glovecal_models.calibration.artifact import dump
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_service.settings import Settings
from glovecal_service.store import Store

pytestmark = pytest.mark.needs_chromium


@pytest.fixture(scope="module")
def take(address: str, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The id of a take of a right hand whose angles were measured, and that has no model."""
    table = tmp_path_factory.mktemp("exported") / "wave.csv"
    rows = [f"{frame / 60},{100 + frame},{frame / 2}" for frame in range(120)]
    table.write_text("\n".join(["time_s,s.I_PIP,r.I_PIP", *rows]) + "\n")
    with RestClient(address) as client:
        client.post("/subjects", {"name": "wendy", "hand": "right"})
        client.upload_takes(table, subject="wendy")
        return client.get("/takes", {"subject": "wendy"})[0]["id"]


@pytest.fixture
def posed(address: str, settings: Settings, tmp_path: Path) -> Iterator[str]:
    """The id of a take whose subject has a model and a hand; removed afterwards."""
    random, time_s = np.random.default_rng(1), np.arange(600) / 60
    bent = 60 + 25 * np.sin(2 * time_s[:, None] + np.arange(2))
    columns = np.column_stack([time_s, 2 * bent + random.normal(0, 3, bent.shape), bent])
    table, names = tmp_path / "moved.csv", ["time_s", "s.I_MCP", "s.I_PIP", "r.I_MCP", "r.I_PIP"]
    np.savetxt(table, columns, delimiter=",", header=",".join(names), comments="", fmt="%.4f")
    with Store.open(settings) as store, RestClient(address) as client:
        client.post("/subjects", {"name": "olaf", "hand": "right"})
        client.upload_takes(table, subject="olaf")
        [take] = client.get("/takes", {"subject": "olaf"})
        layout = store.layouts.get(take["layout"])
        model = train([store.takes.load(take["id"])], layout, "olaf", TrainingSettings(method="linear"))
        record = store.models.add(
            dump(model), subject="olaf", layout=layout.name, method="linear", parent=None, facts={}
        )
        store.models.activate(record.id)
        yield take["id"]
        client.post("/erasures", {"subject": "olaf"})


def test_the_browser_saves_a_take_as_gltf_with_measured_angles(
    opened: Open, take: str, tmp_path: Path
) -> None:
    seen = opened(f"take?id={take}")
    page = seen.page
    page.get_by_text("Export for animation tools and analysis").click()
    expect(page.get_by_text("Read by viewers in browsers")).to_contain_text("In m; x to the body's left")
    assert serious(page) == []
    with page.expect_download() as saved:
        page.get_by_role("button", name="Export the motion").click()
    expect(page.get_by_text("was written: it is among your downloads")).to_be_visible()
    path = tmp_path / "saved.glb"
    saved.value.save_as(path)
    document: Any = pygltflib.GLTF2.load_binary(str(path))
    assert document.animations[0].channels
    assert document.asset.extras["right"]["measured"]
    assert seen.complaints == []


def test_a_character_moves_and_the_page_shows_which_bone_is_which(
    opened: Open, take: str, tmp_path: Path
) -> None:
    write_character(tmp_path / "hero.glb", "mixamo")
    seen = opened(f"take?id={take}")
    page = seen.page
    page.get_by_text("Export for animation tools and analysis").click()
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Choose a character (.glb)").click()
    chooser.value.set_files(tmp_path / "hero.glb")
    bones = page.get_by_role("region", name="Which bone is which, right hand")
    field = bones.get_by_label("index proximal, right")
    expect(field).to_have_value("mixamorig:RightHandIndex1", timeout=PATIENCE_MS)
    expect(page.get_by_role("img", name="The hand, and how it is shown")).to_be_visible()
    assert serious(page) == []
    field.fill("RightHandMiddle1")
    page.get_by_role("option", name="mixamorig:RightHandMiddle1").click()
    expect(page.get_by_role("button", name="Bones as they were found")).to_be_visible()
    expect(bones.get_by_label("index proximal, right")).to_have_value("mixamorig:RightHandMiddle1")
    page.get_by_role("button", name="Bones as they were found").click()
    expect(bones.get_by_label("index proximal, right")).to_have_value("mixamorig:RightHandIndex1")
    expect(page.get_by_role("button", name="Bones as they were found")).to_have_count(0)
    with page.expect_download() as saved:
        page.get_by_role("button", name="Export the motion").click()
    saved.value.save_as(tmp_path / "moved.glb")
    document: Any = pygltflib.GLTF2.load_binary(str(tmp_path / "moved.glb"))
    moved = {document.nodes[channel.target.node].name for channel in document.animations[0].channels}
    assert "mixamorig:RightHandIndex1" in moved
    assert not any("Left" in name for name in moved)
    page.get_by_role("combobox", name="Format").click()
    page.get_by_role("option", name="FBX 7.4, binary (.fbx)").click()
    expect(page.get_by_role("button", name="Choose a character (.glb)")).to_be_hidden()
    expect(bones).to_have_count(0)
    write_fbx_character(tmp_path / "hero.fbx", "mixamo")
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Choose a character (.fbx)").click()
    chooser.value.set_files(tmp_path / "hero.fbx")
    expect(bones.get_by_label("index proximal, right")).to_have_value(
        "mixamorig:RightHandIndex1", timeout=PATIENCE_MS
    )
    with page.expect_download() as saved:
        page.get_by_role("button", name="Export the motion").click()
    saved.value.save_as(tmp_path / "moved.fbx")
    assert b"mixamorig:RightHandIndex1" in (tmp_path / "moved.fbx").read_bytes()
    assert b"Glovecal take" in (tmp_path / "moved.fbx").read_bytes()
    assert seen.complaints == []


def test_a_robots_joints_are_written_in_place_of_the_persons(opened: Open, take: str, tmp_path: Path) -> None:
    seen = opened(f"take?id={take}")
    page = seen.page
    page.get_by_text("Export for animation tools and analysis").click()
    page.get_by_role("combobox", name="Format").click()
    page.get_by_role("option", name="CSV (.csv)").click()
    page.get_by_role("combobox", name="Robot hand").click()
    page.get_by_role("option", name="Shadow").click()
    expect(page.get_by_role("region", name="Which bone is which, right hand")).to_be_visible(
        timeout=PATIENCE_MS
    )
    expect(page.get_by_text("fingertips are")).to_be_visible()
    assert serious(page) == []
    with page.expect_download() as saved:
        page.get_by_role("button", name="Export the motion").click()
    saved.value.save_as(tmp_path / "robot.csv")
    rows = list(csv.DictReader((tmp_path / "robot.csv").read_text().splitlines()))
    bent = [float(row["r.rh_FFJ2"]) for row in rows]
    assert bent[-1] - bent[0] > 40, "the index finger's middle joint bends from 0 to 60 degrees"
    assert seen.complaints == []


def test_a_models_angles_are_written_with_both_directions_of_time_where_that_is_ticked(
    opened: Open, posed: str, tmp_path: Path
) -> None:
    seen = opened(f"take?id={posed}")
    page = seen.page
    page.get_by_text("Export for animation tools and analysis").click()
    page.get_by_role("combobox", name="Format").click()
    page.get_by_role("option", name="CSV (.csv)").click()
    page.get_by_role("combobox", name="What").click()
    page.get_by_role("option", name="Angles of joints").click()
    both_ways = page.get_by_role("checkbox", name="The model's angles with both directions of time")
    expect(both_ways).not_to_be_checked()
    angles = {}
    for name in ("live", "offline"):
        if name == "offline":
            both_ways.click()
            expect(both_ways).to_be_checked()
        with page.expect_download(timeout=PATIENCE_MS) as saved:
            page.get_by_role("button", name="Export the motion").click()
        saved.value.save_as(tmp_path / f"{name}.csv")
        rows = list(csv.DictReader((tmp_path / f"{name}.csv").read_text().splitlines()))
        columns = [column for column in rows[0] if column.startswith("p.")]
        angles[name] = np.array([[float(row[column] or "nan") for column in columns] for row in rows])
    difference = angles["offline"] - angles["live"]
    assert 0.01 < np.nanmax(np.abs(difference)) < 30.0
    # A smooth motion jumps less from frame to frame.
    jumps = {name: float(np.nanmean(np.abs(np.diff(each, n=2, axis=0)))) for name, each in angles.items()}
    assert jumps["offline"] < 0.8 * jumps["live"]
    assert serious(page) == []
    assert seen.complaints == []


def test_what_cannot_be_written_is_said_on_the_page(opened: Open, take: str) -> None:
    page = opened(f"take?id={take}").page
    page.get_by_text("Export for animation tools and analysis").click()
    page.get_by_label("Frames a second").fill("20")
    page.get_by_label("Low-pass filter, Hz").fill("15")
    page.get_by_role("button", name="Export the motion").click()
    expect(page.get_by_text("give at most 9 Hz")).to_be_visible()
