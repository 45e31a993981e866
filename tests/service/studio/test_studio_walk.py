"""What the pages do, by mouse and by keyboard, against the running service."""

from __future__ import annotations

import httpx
import pytest
from playwright.sync_api import expect
from realtime_support import free_endpoint, part_of_service, store_model
from studio_support import Open

from glovecal_service.serve import web
from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.studio.pages.models import AT_ONCE

pytestmark = pytest.mark.needs_chromium


def test_a_version_is_activated_and_rolled_back_by_keyboard(
    opened: Open, address: str, settings: Settings
) -> None:
    with Store.open(settings) as store:  # the newest are on the page's first part
        active = store_model(store, "walker", degrees_per_count=0.3)
        other = store_model(store, "walker", degrees_per_count=0.2, activate=False)
    page = opened("models").page
    page.locator(f'[data-model="{other}"] button', has_text="Activate").press("Enter")
    expect(page.locator(f'[data-model="{other}"] .state-word')).to_have_text("active")
    now = httpx.get(f"{address}/v1/models", params={"subject": "walker"}).json()
    assert [each["id"] for each in now if each["active"]] == [other]
    tree = page.locator("section.tree", has_text="walker, ")
    tree.get_by_role("button", name="Return to the model before").press("Enter")
    expect(page.locator(f'[data-model="{active}"] .state-word')).to_have_text("active")


def test_a_model_made_elsewhere_appears_without_a_reload(
    opened: Open, address: str, settings: Settings
) -> None:
    page = opened("models").page
    expect(page.locator("[data-model]")).to_have_count(
        min(AT_ONCE, len(httpx.get(f"{address}/v1/models").json()))
    )
    store = Store.open(settings)
    made = store_model(store, "made-elsewhere", degrees_per_count=0.7)
    store.close()
    expect(page.locator(f'[data-model="{made}"]')).to_be_visible()


def test_a_diagnosis_of_before_is_shown_with_what_to_do(opened: Open, address: str) -> None:
    job = next(
        each
        for each in httpx.get(f"{address}/v1/jobs").json()
        if each["kind"] == "diagnose" and each["state"] == "done"
    )
    whole = httpx.get(f"{address}/v1/jobs/{job['id']}").json()
    page = opened(f"diagnose?model={job['payload']['model']}").page
    named = whole["result"]["named"]
    assert named is not None
    expect(page.locator(".finding-named")).to_contain_text(named["effect"])
    expect(page.get_by_role("button", name=f"Add {named['effect']}")).to_be_visible()
    expect(page.get_by_role("link", name="Report with pictures")).to_have_attribute(
        "href", f"../v1/jobs/{job['id']}/report"
    )


def test_every_effect_of_the_catalogue_is_explained(opened: Open, address: str) -> None:
    page = opened("effects").page
    told = {each["name"]: each["explanation"] for each in httpx.get(f"{address}/v1/effects").json()}
    expect(page.locator(".cards h2")).to_have_text(list(told))
    for sentence in told.values():
        assert sentence in page.locator("#main").inner_text()


def test_the_skip_link_is_first_and_leads_to_the_content(opened: Open) -> None:
    page = opened("effects").page
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.innerText") == "Skip to content"
    page.keyboard.press("Enter")
    assert page.url.endswith("#main")


def test_without_the_studio_nothing_of_it_is_served(settings: Settings) -> None:
    port = int(free_endpoint().rpartition(":")[2])
    bare = settings.model_copy(update={"studio": False, "port": port})
    with part_of_service(web, bare):
        assert httpx.get(f"http://127.0.0.1:{port}/studio/live").status_code == 404
        assert "studio/live" not in httpx.get(f"http://127.0.0.1:{port}/").text
