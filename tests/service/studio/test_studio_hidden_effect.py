"""The heart of the studio, walked in a real browser: where a model fails, what it lacks, adding it, its fall.

The glove sticks, and no model knows it. Once by mouse, once by touch on a tablet held upright and once by
keyboard alone, against the running service with the glove's capture as a process. Pictures of each page go to
the folder named by GLOVECAL_SCREENSHOTS, or to the test's own temporary folder.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import pytest
from playwright.sync_api import Locator, Page, expect
from realtime_support import eventually
from small_session import CAUSE, sticky_session
from studio_support import Open, with_calibration

from glovecal_client.rest import RestClient
from glovecal_models.takes.write_table import write_takes
from glovecal_service.demo.processes import DemoPlace, running_capture
from glovecal_service.first_run.hidden_session import HiddenSession
from glovecal_service.settings import Settings

pytestmark = pytest.mark.needs_chromium
SUBJECT, GLOVE = "pia", "sticky-hand"
MOST_TABS = 120


@dataclass(frozen=True)
class Story:
    """The service, and the model that does not know of the effect."""

    client: RestClient
    model: str

    def active(self) -> dict[str, Any]:
        return next(
            each for each in self.client.get("/models") if each["subject"] == SUBJECT and each["active"]
        )


class Person(Protocol):
    def choose(self, what: Locator) -> None:
        """Press a button, follow a link."""
        ...


class Mouse:
    def choose(self, what: Locator) -> None:
        what.click()


class Finger:
    def choose(self, what: Locator) -> None:
        what.tap()


class Keyboard:
    """From where the focus is, forward to what is wanted."""

    def __init__(self, page: Page) -> None:
        self._page = page

    def choose(self, what: Locator) -> None:
        what.wait_for()
        for _ in range(MOST_TABS):
            self._page.keyboard.press("Tab")
            if what.evaluate("element => element === document.activeElement"):
                self._page.keyboard.press("Enter")
                return
        pytest.fail(f"not reached by {MOST_TABS} presses of Tab: {what}")


@pytest.fixture(scope="module")
def story(settings: Settings, address: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Story]:
    """Six takes learned from, two held out, and the glove streams one more again and again."""
    hidden, folder = HiddenSession(sticky_session(), 3), tmp_path_factory.mktemp("story")
    with ExitStack() as running:
        client = running.enter_context(RestClient(address))
        layout, model = with_calibration(settings, client, hidden, folder, SUBJECT)
        more = hidden.live(20.0).take
        write_takes([more], folder / "more.csv")
        running.enter_context(
            running_capture(
                DemoPlace(folder, settings.zenoh, settings.port),
                device=f"replay:{folder / 'more.csv'}",
                glove=GLOVE,
                subject=SUBJECT,
                wearing=more.wearing,
                options={"layout": layout, "loop": "yes"},
            )
        )
        yield Story(client, model)


@pytest.mark.parametrize("by", ["mouse", "touch", pytest.param("keyboard", marks=pytest.mark.slow)])
def test_the_missing_effect_is_seen_named_added_and_live(
    opened: Open, story: Story, tmp_path: Path, by: str
) -> None:
    story.client.post(f"/models/{story.model}/activate")
    seen = opened(f"compare?models={story.model[:12]}", tablet=by == "touch")
    page = seen.page
    main = page.locator("#main")
    people: dict[str, Person] = {"mouse": Mouse(), "touch": Finger(), "keyboard": Keyboard(page)}
    person = people[by]
    kept = Path(os.environ.get("GLOVECAL_SCREENSHOTS") or tmp_path)
    kept.mkdir(parents=True, exist_ok=True)

    def picture(name: str) -> None:
        page.screenshot(path=kept / f"{by}-{name}.png", full_page=True)
        wide = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
        assert wide <= 0, f"{name} is cut at the side"

    stretch = main.get_by_role("button").filter(has_text="over all rotations")
    stretch.first.wait_for()
    expect(main).to_contain_text("× floor")
    person.choose(stretch.first)
    expect(main.locator(".hand-view canvas")).to_be_visible()
    picture("1-compare")

    person.choose(main.get_by_role("link", name="Diagnose", exact=True))
    expect(page.get_by_role("heading", level=1)).to_have_text("Diagnose")
    person.choose(main.get_by_role("button", name="Diagnose", exact=True))
    add = main.get_by_role("button", name=f"Add {CAUSE}").first
    add.wait_for()
    expect(main).to_contain_text(
        re.compile(rf"{CAUSE} on .* explains \d+ % of the squared error of these sensors")
    )
    expect(main.get_by_role("progressbar")).to_be_hidden()
    expect(main).not_to_contain_text("Drawing")  # until then what lies below a picture goes on moving
    picture("2-diagnose")

    goes_live = main.get_by_role("checkbox", name="Live poses come from it")
    person.choose(goes_live)
    expect(goes_live).to_be_checked()
    person.choose(add)
    fall = main.get_by_role("link", name="See the error fall").last
    fall.wait_for()
    expect(main).to_contain_text(f"{CAUSE} was added")
    picture("3-added")
    child = story.active()
    assert (child["parent"], child["effects"]) == (story.model, [CAUSE])

    person.choose(fall)
    expect(page.get_by_role("heading", level=1)).to_have_text("Error fall")
    told = main.get_by_text("The error falls from").first
    expect(told).to_contain_text(f"with {CAUSE}")
    before = story.client.get(f"/models/{story.model}")["held_out_rmse_deg"]
    assert child["held_out_rmse_deg"] < 0.8 * before
    picture("4-fall")

    person.choose(main.get_by_role("link", name="See it live"))
    card = page.get_by_role("region", name=f"Glove {GLOVE}")
    expect(card.get_by_role("status")).to_contain_text(re.compile("ok|settling"))
    expect(card.get_by_label(f"Model of {SUBJECT}")).to_have_value(re.compile(re.escape(f"+ {CAUSE}")))
    canvas = card.locator(".hand-view canvas")
    first = canvas.screenshot()
    eventually(lambda: canvas.screenshot() != first, "the hand moves", deadline_s=20)
    picture("5-live")
    assert seen.complaints == []
