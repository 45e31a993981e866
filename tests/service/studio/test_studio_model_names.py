"""A version is named where it stands, removed, and brought back."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect
from realtime_support import eventually
from studio_support import Open

from glovecal_client.rest import RestClient

pytestmark = pytest.mark.needs_chromium


def test_a_version_is_named_removed_and_brought_back(opened: Open, address: str) -> None:
    with RestClient(address) as client:
        every = client.get("/models")
        used = {model["parent"] for model in every}
        model = next(each["id"] for each in every if not each["active"] and each["id"] not in used)
        seen = opened("models")
        page = seen.page
        version = page.locator(f'article[data-model="{model}"]')
        version.get_by_label("Name").fill("Monday")
        version.get_by_label("Name").press("Tab")
        version.get_by_label("Note").fill("cold room")
        version.get_by_label("Note").press("Tab")
        said = {"name": "Monday", "note": "cold room"}
        eventually(lambda: said.items() <= client.get(f"/models/{model}").items(), "both are kept")
        version.get_by_role("button", name="Remove").click()
        expect(version).to_have_count(0)
        page.get_by_role("button", name="Undo").click()
        expect(version).to_be_visible()
        expect(version.get_by_label("Name")).to_have_value("Monday")
        expect(version.get_by_label("Note")).to_have_value("cold room")
        client.put(f"/models/{model}/name", {"name": ""})
        assert seen.complaints == []
