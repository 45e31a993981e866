"""A take's motion as a file, from its page: what the browser saves is what another program reads."""

from __future__ import annotations

from pathlib import Path

import pygltflib
import pytest
from playwright.sync_api import expect
from studio_support import Open, serious

from glovecal_client.rest import RestClient

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
    document = pygltflib.GLTF2.load_binary(str(path))
    assert document is not None
    assert document.animations[0].channels
    assert document.asset.extras["right"]["measured"]
    assert seen.complaints == []


def test_what_cannot_be_written_is_said_on_the_page(opened: Open, take: str) -> None:
    page = opened(f"take?id={take}").page
    page.get_by_text("Export for animation tools and analysis").click()
    page.get_by_label("Frames a second").fill("20")
    page.get_by_label("Low-pass filter, Hz").fill("15")
    page.get_by_role("button", name="Export the motion").click()
    expect(page.get_by_text("give at most 9 Hz")).to_be_visible()
