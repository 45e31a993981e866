"""Models in the browser: taken apart, imported; takes with their quality, gloves, layouts."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import httpx
import numpy as np
import pytest
import safetensors.numpy
from effect_models import CREEP, HYSTERESIS, model_with
from playwright.sync_api import expect
from realtime_support import LAYOUT
from studio_support import Open, serious

from glovecal_models.calibration.artifact import dump, model_id, read_manifest
from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.studio.pages.takes_table import AT_ONCE

pytestmark = pytest.mark.needs_chromium
SMALL = dump(replace(model_with(HYSTERESIS, CREEP), layout=replace(LAYOUT, name="three-bends-elsewhere")))
ARTIFACT = safetensors.numpy.save(
    safetensors.numpy.load(SMALL) | {"spare": np.zeros(1_150_000)},
    metadata={"manifest": json.dumps(read_manifest(SMALL))},
)
"""9 MB, more than REST takes of anything but files."""


@pytest.fixture(scope="module")
def remembering(settings: Settings, address: str) -> str:
    """The id of a model with two effects."""
    with Store.open(settings) as store:
        store.subjects.create("taken-apart")
        return store.models.add(
            dump(model_with(CREEP)), subject="taken-apart", layout=LAYOUT.name, method="linear",
            parent=None, facts={},
        ).id  # fmt: skip


def test_a_model_is_taken_apart_by_keyboard(opened: Open, address: str, remembering: str) -> None:
    found = httpx.get(f"{address}/v1/models/{remembering}").json()
    seen = opened("models")
    version = seen.page.locator(f'[data-model="{remembering}"]')
    version.get_by_role("button", name="Look inside").press("Enter")
    expect(version.get_by_role("heading", name="Effect 1: creep")).to_be_visible()
    [effect] = found["effect_details"]
    learned = version.get_by_role("region", name="What creep learned").locator("tbody tr")
    expect(learned.locator("th")).to_have_text(list(effect["parameters"]))
    numbers = next(iter(effect["parameters"].values()))
    assert learned.first.locator("td").first.inner_text() == f"{next(iter(numbers.values())):.4g}"
    rotations = version.get_by_role("region", name="Rotations of the model").locator("tbody th")
    expect(rotations).to_have_text([one["rotation"] for one in found["rotations"]])
    assert serious(seen.page) == []
    assert version.get_by_role("button", name="Take creep out").is_enabled()
    assert seen.complaints == []


def test_a_report_is_one_click_and_opens_as_a_page_and_as_pdf(opened: Open, trained: str) -> None:
    seen = opened("models")
    version = seen.page.locator(f'[data-model="{trained}"]')
    version.get_by_role("button", name="Report", exact=True).press("Enter")
    links = [seen.page.get_by_role("link", name=name) for name in ("Open the report", "As PDF")]
    expect(links[0]).to_be_visible()
    page, pdf = (httpx.get(link.evaluate("each => each.href")) for link in links)
    assert "<h1>Calibration of anna" in page.text
    assert (pdf.headers["content-type"], pdf.content[:5]) == ("application/pdf", b"%PDF-")
    assert seen.complaints == []


def test_a_model_is_imported_and_a_file_that_is_none_refused(
    opened: Open, address: str, tmp_path: Path
) -> None:
    seen = opened("models")
    page, notice = seen.page, seen.page.locator(".studio-notice").first
    before = httpx.get(f"{address}/v1/models").json()
    for name, content, said in (
        ("notes.txt", b"no model", "A file here is .safetensors, of at most 256 MB"),
        ("broken.safetensors", SMALL[:-100], "no model was imported"),
        ("good.safetensors", ARTIFACT, f"Model {model_id(ARTIFACT)[:12]} of anna was imported"),
        ("good.safetensors", ARTIFACT, "was here already"),
    ):
        file = tmp_path / name
        file.write_bytes(content)
        with page.expect_file_chooser() as chooser:
            page.get_by_role("button", name="Import a model").press("Enter")
        chooser.value.set_files(file)
        expect(notice).to_contain_text(said)
    added = [each for each in httpx.get(f"{address}/v1/models").json() if each not in before]
    assert [(each["id"], each["active"]) for each in added] == [(model_id(ARTIFACT), False)]
    expect(page.locator(f'[data-model="{model_id(ARTIFACT)}"]')).to_be_visible()
    assert seen.complaints == []


def test_takes_have_their_quality_and_gloves_their_layouts(
    opened: Open, settings: Settings, address: str
) -> None:
    with Store.open(settings) as store:
        store.gloves.seen("seen-once", {"layout": LAYOUT.name, "simulated": True})
    page = opened("takes").page
    takes = httpx.get(f"{address}/v1/takes", params={"reverse": True, "limit": AT_ONCE}).json()
    rows = page.get_by_role("region", name="Takes and their quality").locator("tbody tr")
    expect(rows).to_have_count(len(takes))
    for take in takes[:2]:
        check = httpx.get(f"{address}/v1/takes/{take['id']}/check").json()
        row = page.locator(f'[data-take="{take["id"]}"]')
        expect(row.locator(".take-quality")).to_contain_text(f"{check['rate_hz']:.1f} Hz")
        for sentence in check["sentences"][:2]:
            expect(row).to_contain_text(sentence)
    page = opened("models").page
    layouts = page.get_by_role("region", name="Layouts").last.locator("tbody th")
    gloves = httpx.get(f"{address}/v1/gloves").json()
    expect(layouts).to_have_text([each["name"] for each in gloves["layouts"]])
    seen = page.get_by_role("region", name="Gloves seen").last.locator("tbody th").all_inner_texts()
    assert [text.removesuffix(" (simulated)") for text in seen] == [each["name"] for each in gloves["seen"]]
    assert "seen-once (simulated)" in seen
    page.get_by_role("button", name="Remove glove seen-once").click()
    expect(page.get_by_role("row", name="seen-once")).to_have_count(0)
    left = httpx.get(f"{address}/v1/gloves").json()["seen"]
    assert [each["name"] for each in left] == [
        each["name"] for each in gloves["seen"] if each["name"] != "seen-once"
    ]
