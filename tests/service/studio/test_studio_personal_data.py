"""What is kept of a person, on the page: all of it as a file, and its erasure."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import expect
from studio_support import Open, serious, without_focus

pytestmark = pytest.mark.needs_chromium


def test_all_that_is_kept_of_a_person_is_saved_from_the_page(
    opened: Open, address: str, tmp_path: Path
) -> None:
    httpx.post(f"{address}/v1/subjects", json={"name": "zoe"})
    seen = opened("models")
    part = seen.page.get_by_role("region", name="Personal data")
    part.get_by_label("Whose").click()
    seen.page.get_by_role("option", name="anna", exact=True).click()
    link = part.get_by_role("link", name="Export all data of anna")
    expect(link).to_be_visible()
    with seen.page.expect_download() as saving:
        link.click()
    assert saving.value.suggested_filename == "anna.zip"
    saving.value.save_as(tmp_path / "anna.zip")
    with zipfile.ZipFile(tmp_path / "anna.zip") as archive:
        manifest = json.loads(archive.read("manifest.json"))
    takes = httpx.get(f"{address}/v1/takes", params={"subject": "anna"}).json()
    names = {row["name"] for row in manifest["files"]}
    assert {f"takes/{take['id']}/take-1.safetensors" for take in takes} <= names
    assert manifest["problems"] == []
    assert serious(seen.page) == []
    assert without_focus(seen.page) == []
    assert seen.complaints == []


def test_a_person_is_erased_once_the_name_is_typed(opened: Open, address: str) -> None:
    httpx.post(f"{address}/v1/subjects", json={"name": "yuri"})
    seen = opened("models")
    part = seen.page.get_by_role("region", name="Personal data")
    part.get_by_label("Whose").click()
    seen.page.get_by_role("option", name="yuri", exact=True).click()
    part.get_by_role("button", name="Erase yuri").click()
    erase = part.get_by_role("button", name="Erase for ever")
    expect(erase).to_be_disabled()
    field = part.get_by_label("Type the name to erase it for ever")
    field.fill("anna")
    expect(erase).to_be_disabled()
    field.fill("yuri")
    expect(erase).to_be_enabled()
    assert serious(seen.page) == []
    assert without_focus(seen.page) == []
    erase.click()
    expect(part.get_by_role("status")).to_contain_text("no longer say who it was")
    expect(part.get_by_role("status")).to_contain_text("made elsewhere still hold the subject")
    names = [row["name"] for row in httpx.get(f"{address}/v1/subjects").json()]
    assert "yuri" not in names
    assert "anna" in names
    part.get_by_label("Whose").click()
    expect(seen.page.get_by_role("option", name="yuri", exact=True)).to_have_count(0)
    assert seen.complaints == []
