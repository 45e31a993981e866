"""Diagnose, Error fall and Effects in a real browser: what REST gives, and names as text."""

from __future__ import annotations

from collections.abc import Callable

import httpx
import pytest
from playwright.sync_api import Page, expect
from studio_support import Open, serious

pytestmark = pytest.mark.needs_chromium
HOSTILE = "<img src=x onerror=alert(1)>"


@pytest.fixture(scope="module")
def diagnosis(address: str) -> dict:
    """The stored one, in full."""
    jobs = httpx.get(f"{address}/v1/jobs").json()
    job = next(each for each in jobs if each["kind"] == "diagnose" and each["state"] == "done")
    return httpx.get(f"{address}/v1/jobs/{job['id']}").json()["result"]


def document(page: Page, place: str) -> dict:
    """What the chart there was given."""
    return page.evaluate(
        "place => getElement(document.querySelector(place).id.slice(1)).$props.document", place
    )


def test_the_picture_of_the_named_effect_has_the_points_of_rest(
    opened: Open, address: str, diagnosis: dict
) -> None:
    page = opened(f"diagnose?model={diagnosis['model']}").page
    named = diagnosis["named"]
    expect(page.locator(".finding-facts")).to_contain_text("No other effect explains")
    expect(page.locator(".candidate-table tbody tr")).not_to_have_count(0)
    for item in diagnosis["not_identifiable"]:
        expect(page.locator(".reasons", has_text=item["why"]).first).to_be_visible()
    sentence = page.locator(".effect-sentence")
    expect(sentence).not_to_have_text("Drawing …")
    shown = document(page, ".effect-view div:has(> .effect-plot)")["before"]
    body = {"effect": named["effect"], "takes": [take["id"] for take in diagnosis["takes"]]}
    asked = httpx.post(
        f"{address}/v1/models/{diagnosis['model']}/effect-picture", timeout=60,
        json=body | {"rotation": shown["rotation"]},
    ).json()  # fmt: skip
    assert shown == asked
    assert shown["rotation"] in named["where"]
    assert sentence.inner_text() == asked["sentence"]
    assert serious(page) == []


def test_the_fall_goes_over_simpler_calibrations_and_both_hands_are_replayed(
    opened: Open, address: str
) -> None:
    models = httpx.get(f"{address}/v1/models").json()
    child = next(each for each in models if each["parent"])
    fall = httpx.get(f"{address}/v1/models/{child['id']}/fall", timeout=60).json()
    page = opened(f"fall?model={child['id']}").page
    expect(page.locator(".fall canvas")).to_be_visible()
    assert document(page, ".fall") == {"steps": fall["steps"], "floor": fall["floor"]}
    line = httpx.get(f"{address}/v1/models/{child['id']}/lineage").json()
    assert [step["model"] for step in fall["steps"] if step["model"]] == [each["id"] for each in line[::-1]]
    assert fall["floor"]["low_deg"] <= fall["floor"]["floor_deg"] <= fall["floor"]["high_deg"]
    expect(page.locator(".fall-hand canvas")).to_have_count(2)
    expect(page.locator(".tips li").first).to_contain_text("→")
    effect = child["effects"][-1]
    expect(page.get_by_role("button", name=f"Take {effect} out")).to_be_visible()


def test_the_next_version_grows_where_it_will_stand(
    opened: Open, address: str, long_job: Callable[[], str]
) -> None:
    """A job of the line is followed in the chart; here it is shown without waiting for one: it waits
    behind two others, or the version might be made before it is cancelled."""
    child = next(each for each in httpx.get(f"{address}/v1/models").json() if each["parent"])
    others = [long_job(), long_job()]
    page = opened(f"fall?model={child['id']}").page
    page.locator(".fall canvas").wait_for()
    page.get_by_role("button", name="Take").click()
    expect(page.locator(".legend", has_text="being made")).to_be_visible()
    page.get_by_role("region", name="Running job").get_by_role("button", name="Cancel").click()
    expect(page.locator(".legend", has_text="being made")).to_have_count(0)
    for other in others:
        assert httpx.get(f"{address}/v1/jobs/{other}").json()["state"] == "running"


def test_every_effect_has_the_picture_of_rest_and_an_expression_is_tried(
    opened: Open, address: str, diagnosis: dict
) -> None:
    seen = opened(f"effects?model={diagnosis['model']}")
    page = seen.page
    drawn = [each for each in httpx.get(f"{address}/v1/effects").json() if each["kind"] != "nothing"]
    expect(page.locator(".schematic")).to_have_count(len(drawn))
    expression = page.get_by_role("textbox", name="Expression")
    problem, verdict = page.locator(".expression-problem"), page.locator(".own-effect > .effect-sentence")
    expect(verdict).to_contain_text("On left-out takes")
    expect(page.locator(".own-effect .candidate-table tbody tr")).to_have_count(1)
    expression.fill(f"name = mine; columns = {HOSTILE}")
    expect(problem).to_contain_text("img src")
    assert page.locator("img").count() == 0
    expression.fill("name = mine; columns = lowpss(own, 1)")
    expect(problem).to_contain_text("no function 'lowpss'")
    page.wait_for_timeout(200)
    assert seen.complaints == []


def test_names_are_refused_and_titles_are_text(opened: Open, address: str) -> None:
    assert httpx.post(f"{address}/v1/subjects", json={"name": HOSTILE}).status_code == 422
    titled = httpx.post(f"{address}/v1/subjects", json={"name": "hostile", "title": HOSTILE})
    assert titled.json()["title"] == HOSTILE
    seen = opened("models")
    seen.page.wait_for_timeout(500)
    assert seen.page.locator("img").count() == 0
    assert seen.complaints == []


def test_a_hand_is_measured_where_its_picture_says(opened: Open, address: str) -> None:
    page = opened("models").page
    form = page.get_by_role("region", name="Hand dimensions")
    subject = httpx.get(f"{address}/v1/subjects").json()[0]["name"]
    sizes = httpx.get(f"{address}/v1/subjects/{subject}/skeleton").json()["dimensions"]["sizes"]
    expect(form.locator(".hand-number-text")).to_have_count(len(sizes))
    form.get_by_label("1 hand_length, mm").fill("187.5")
    form.get_by_role("button", name="Save").click()
    expect(form.get_by_text("Saved.")).to_be_visible()
    assert httpx.get(f"{address}/v1/subjects/{subject}").json()["dimensions"] == {"hand_length": 187.5}
    form.get_by_label("2 hand_breadth, mm").fill("300")
    form.get_by_role("button", name="Save").click()
    expect(form.get_by_role("status")).to_contain_text("hand_breadth")
