"""The way in without anything: a simulated hand moves, a hidden effect is found, a glove is tested live."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from playwright.sync_api import expect
from realtime_support import LAYOUT, eventually, free_endpoint, part_of_service
from studio_support import SEED, Open, moving, serious, web_that_draws

from glovecal_client.rest import RestClient
from glovecal_client.session import open_client
from glovecal_service.first_run.hidden_session import hidden_session
from glovecal_service.serve import real_time
from glovecal_service.settings import Settings

pytestmark = pytest.mark.needs_chromium


@pytest.fixture(scope="module")
def nothing(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Settings]:
    """A service on a folder of its own, with nothing in it."""
    port = int(free_endpoint().rpartition(":")[2])
    data = tmp_path_factory.mktemp("nothing") / "data"
    settings = Settings(data=data, zenoh=free_endpoint(), port=port, workers=1)
    with ExitStack() as running:
        for work in (real_time, web_that_draws):
            running.enter_context(part_of_service(work, settings))
        yield settings


def test_a_simulated_hand_moves_and_a_hidden_effect_is_found(opened: Open, nothing: Settings) -> None:
    at = f"http://127.0.0.1:{nothing.port}"
    seen = opened("live", at=at)
    page = seen.page
    truth = hidden_session("random", SEED).truth
    assert truth is not None

    page.get_by_role("link", name="Try a simulated glove").first.click()
    page.get_by_role("button", name="Try a simulated glove").click()
    expect(page.get_by_text("Streams, simulated")).to_be_visible()
    page.get_by_role("button", name="Hide an effect").click()
    walk = page.get_by_role("region", name=f"Hidden effect of hidden-{SEED}")
    expect(walk).to_contain_text("The model that does not know of it is being trained")
    assert serious(page) == []

    page.get_by_role("link", name="See its hand move").click()
    card = page.get_by_role("region", name="Glove simulated-glove")
    expect(card.get_by_role("status")).to_contain_text(re.compile("(ok|settling), simulated"))
    canvas = card.locator(".hand-view canvas")
    first = canvas.screenshot()
    eventually(lambda: canvas.screenshot() != first, "the hand moves", deadline_s=60)

    page.get_by_role("link", name="Start", exact=True).click()
    page.get_by_role("button", name="Stop it").click()
    expect(page.get_by_role("button", name="Try a simulated glove")).to_be_visible()
    walk.get_by_role("link", name="Compare").click()
    expect(page.locator("#main")).to_contain_text("× floor")
    assert truth.name not in page.locator("#main").inner_text()
    walk.get_by_role("link", name="Diagnose").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Diagnose")
    assert truth.name not in page.locator("#main").inner_text()
    page.get_by_role("button", name="Diagnose", exact=True).click()
    page.get_by_role("button", name=f"Add {truth.name}").first.click()
    expect(walk).to_contain_text(f"Right: {truth.name} was hidden.")
    walk.get_by_role("link", name="See the error fall").click()
    expect(page.locator("#main")).to_contain_text(f"with {truth.name}")
    expect(walk).to_contain_text(truth.description)
    assert seen.complaints == []
    with RestClient(at) as client:
        assert client.get("/simulated-glove")["is_on"] is False


def test_a_connected_glove_shows_which_sensor_answers(opened: Open, nothing: Settings) -> None:
    page = opened("start", at=f"http://127.0.0.1:{nothing.port}").page
    page.get_by_role("button", name="Look for ports").click()
    expect(page.get_by_text("No serial port was found")).to_be_visible()
    page.get_by_label("Who wears it").fill("dora")
    page.get_by_label("Your glove").click()
    page.get_by_role("option", name="lucidglove").click()
    ending = re.escape(f" --glove right --subject dora --connect {nothing.zenoh}")
    command = re.compile(rf"glovecal capture --device lucidglove:PORT{ending}")
    expect(page.get_by_text(command)).to_be_visible()
    test = page.get_by_role("region", name="Which sensor answers which finger?")
    expect(test).to_contain_text("No glove streams yet")
    acts = {"still"}
    with open_client([nothing.zenoh], wait_s=10) as session, moving(session, nothing, "mine", None, acts):
        test.get_by_role("button", name="Test it").click()
        expect(test).to_contain_text("Now move your index finger, and nothing else.")
        acts.add("one")
        acts.discard("still")
        expect(test).to_contain_text(re.compile(rf"Your index finger: {LAYOUT.sensors[0]} \(\d+ counts"))
        row = test.get_by_role("row", name=re.compile(f"^{LAYOUT.sensors[0]}"))
        expect(row).to_contain_text("index finger")
