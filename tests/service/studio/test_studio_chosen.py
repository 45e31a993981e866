"""Who and which model a tab is about: chosen once, kept from page to page; long lists page by page."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect
from realtime_support import store_model
from studio_support import Open, serious

from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.studio.person_choice import MOST_OFFERED

pytestmark = pytest.mark.needs_chromium


@pytest.fixture(scope="module")
def kim(settings: Settings, address: str) -> tuple[str, str]:
    """Two models of kim; the first one is active."""
    with Store.open(settings) as store:
        first = store_model(store, "kim", degrees_per_count=0.3)
        return first, store_model(store, "kim", degrees_per_count=0.2, activate=False)


def choose(page: Page, label: str, option: str) -> None:
    page.get_by_role("combobox", name=label, exact=True).click()
    page.get_by_role("option", name=option).click()


def go_to(page: Page, name: str) -> None:
    page.get_by_role("navigation", name="Pages").get_by_role("link", name=name).click()
    expect(page.get_by_role("heading", level=1)).to_contain_text(name)


def test_a_person_and_a_model_stay_from_page_to_page(opened: Open, kim: tuple[str, str]) -> None:
    first, second = kim
    seen = opened("takes")
    page = seen.page
    choose(page, "Person", "kim")
    expect(page).to_have_title("kim – Takes – Glovecal")
    go_to(page, "Diagnose")
    model = page.get_by_role("combobox", name="Model", exact=True)
    expect(model).to_have_value(re.compile(first[:12]))
    choose(page, "Model", second[:12])
    expect(page).to_have_url(re.compile(rf"diagnose\?model={second}"))
    for name in ("Effects", "Error fall", "Live", "Diagnose"):
        go_to(page, name)
        expect(page).to_have_title(f"kim – {name} – Glovecal")
        expect(page.get_by_role("combobox", name="Person", exact=True)).to_have_value("kim")
    expect(model).to_have_value(re.compile(second[:12]))
    assert serious(page) == []
    assert seen.complaints == []


def test_a_model_that_is_not_there_is_told_and_the_person_stays(opened: Open, kim: tuple[str, str]) -> None:
    page = opened("diagnose?model=ffffffffffff&who=kim").page
    expect(page.get_by_text("There is no model ffffffffffff.")).to_be_visible()
    expect(page).to_have_title("kim – Diagnose – Glovecal")
    empty = opened("fall?who=nobody").page
    expect(empty.get_by_role("combobox", name="Person", exact=True)).not_to_have_value("nobody")


def test_long_lists_are_filtered_and_turned(opened: Open, settings: Settings, kim: tuple[str, str]) -> None:
    with Store.open(settings) as store:
        for number in range(45):
            job = store.jobs.create("diagnose", {"model": kim[number % 2]}, subject="kim")
            store.jobs.request_cancel(job.id)  # most at once; one that was begun meanwhile ends as it ends
    page = opened("jobs").page
    rows = page.get_by_role("region", name="Jobs, the newest first").locator("tbody tr")
    expect(rows).to_have_count(40)
    page.get_by_label("Filter jobs").fill(f"kim {kim[1][:12]}")
    expect(rows).to_have_count(22)
    expect(rows.first).to_contain_text(f"model {kim[1][:12]}")
    page.get_by_label("Filter jobs").fill("kim")
    expect(page.get_by_text("1 to 40", exact=True)).to_be_visible()
    page.get_by_role("button", name="Older").click()
    expect(page.get_by_text("41 to 45", exact=True)).to_be_visible()
    expect(rows).to_have_count(5)
    page.get_by_role("button", name="Newer").click()
    expect(rows).to_have_count(40)
    assert serious(page) == []


@pytest.fixture
def crowd(settings: Settings) -> Iterator[list[str]]:
    """More people than a list offers; other pages' tests do without them."""
    names = [f"zoe-{number:03d}" for number in range(MOST_OFFERED + 20)]
    with Store.open(settings) as store:
        for name in names:
            store.subjects.create(name)
        yield names
        for name in names:
            store.subjects.remove(name)


def test_one_of_many_people_is_looked_for_by_typing(opened: Open, crowd: list[str]) -> None:
    seen = opened("takes")
    page, last = seen.page, crowd[-1]
    person = page.get_by_role("banner").get_by_label("Person")
    person.click()
    person.fill(last[-3:])
    page.get_by_role("option", name=last, exact=True).click()
    expect(page).to_have_url(re.compile(rf"who={last}$"))
    expect(page.get_by_role("banner").get_by_label("Person")).to_have_value(last)
    assert serious(page) == []
    assert seen.complaints == []
