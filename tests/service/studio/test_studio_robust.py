"""What happens beside an open page: the service restarts, another page or a script changes things."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import httpx
import pytest
import zenoh
from playwright.sync_api import Page, expect
from realtime_support import free_endpoint, part_of_service, store_model
from studio_support import Open, moving, serious

from glovecal_client.session import open_client
from glovecal_service.serve import web
from glovecal_service.settings import Settings
from glovecal_service.store import Store

pytestmark = pytest.mark.needs_chromium
SUBJECT = "bertha"


@pytest.fixture(scope="module")
def session(settings: Settings, address: str) -> Iterator[zenoh.Session]:
    with open_client((settings.zenoh,), wait_s=60.0) as session:
        yield session


@pytest.fixture(scope="module")
def versions(settings: Settings, address: str) -> tuple[str, str]:
    """Two models of one subject; the first is active."""
    with Store.open(settings) as store:
        later = store_model(store, SUBJECT, degrees_per_count=0.3)
        first = store_model(store, SUBJECT, degrees_per_count=0.4)
    return first, later


def activate(address: str, model: str) -> None:
    httpx.post(f"{address}/v1/models/{model}/activate").raise_for_status()


def named(model: str) -> re.Pattern[str]:
    """How a choice of models shows it."""
    return re.compile(rf"\({model[:12]}\)")


def calibrated(page: Page, glove: str) -> None:
    word = page.get_by_role("region", name=f"Glove {glove}").locator(".state-word")
    expect(word).to_have_text("ok")


@pytest.mark.slow
def test_a_page_says_that_its_service_is_gone_and_goes_on_with_the_next(
    opened: Open, session: zenoh.Session, settings: Settings, versions: tuple[str, str]
) -> None:
    port = int(free_endpoint().rpartition(":")[2])
    own = settings.model_copy(update={"port": port})
    with moving(session, settings, "patient", SUBJECT), ExitStack() as running:
        running.enter_context(part_of_service(web, own))
        page = opened("live", at=f"http://127.0.0.1:{port}").page
        calibrated(page, "patient")
        running.close()
        expect(page.get_by_text("Connection lost.")).to_be_visible()
        with part_of_service(web, own):
            expect(page.get_by_text("Connection lost.")).to_be_hidden()
            calibrated(page, "patient")
            canvas = page.get_by_role("region", name="Glove patient").locator(".hand-view canvas")
            first = canvas.screenshot()
            page.wait_for_timeout(1000)
            assert canvas.screenshot() != first


def test_a_model_that_is_activated_elsewhere_is_shown_on_every_open_page(
    opened: Open, address: str, session: zenoh.Session, settings: Settings, versions: tuple[str, str]
) -> None:
    first, later = versions
    activate(address, first)
    with moving(session, settings, "two-tabs", SUBJECT):
        tabs = [opened("live"), opened("live")]
        choices = []
        for seen in tabs:
            calibrated(seen.page, "two-tabs")
            card = seen.page.get_by_role("region", name="Glove two-tabs")
            choices.append(card.get_by_label(f"Model of {SUBJECT}"))
            expect(choices[-1]).to_have_value(named(first))
        listed = opened("models").page
        activate(address, later)
        for choice in choices:
            expect(choice).to_have_value(named(later))
        word = listed.locator(f'[data-model="{later}"]').get_by_text("active", exact=True)
        expect(word).to_be_visible()
        with Store.open(settings) as store:
            made = store_model(store, SUBJECT, degrees_per_count=0.6)
        for choice in choices:
            expect(choice).to_have_value(named(made))
        assert [seen.complaints for seen in tabs] == [[], []]
        active = [each["id"] for each in httpx.get(f"{address}/v1/models").json() if each["active"]]
        assert made in active


def test_a_job_is_cancelled_from_the_drawer_and_every_open_page_is_told(
    opened: Open, address: str, long_job: Callable[[], str]
) -> None:
    one, other = opened("models").page, opened("effects").page
    expect(other.get_by_role("button", name="Jobs", exact=True)).to_be_visible()
    job = long_job()
    other.get_by_role("button", name="Jobs (1 running)").click()
    other.get_by_role("dialog").get_by_role("button", name="Cancel").wait_for()
    for scheme in ("dark", "light"):
        other.emulate_media(color_scheme=scheme)
        other.wait_for_timeout(500)
        assert serious(other) == []
    other.get_by_role("dialog").get_by_role("button", name="Cancel").click()
    for page in (one, other):
        expect(page.get_by_text("detectability: cancelled").first).to_be_visible()
    assert httpx.get(f"{address}/v1/jobs/{job}").json()["state"] == "cancelled"


def test_a_model_that_is_not_there_is_said_so(opened: Open) -> None:
    for name in ("diagnose", "fall"):
        page = opened(f"{name}?model=0123456789abcdef").page
        expect(page.get_by_text("There is no model 0123456789ab.")).to_be_visible()
