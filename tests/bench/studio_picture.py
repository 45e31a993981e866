"""Pictures of the studio for README and docs/, from running pages, in one walk: a file is dropped, its take
is looked at, a model fails, what its glove hides is named and added, and the hand moves live.

python3 do.py picture [FOLDER]     default docs/pictures
"""

from __future__ import annotations

import base64
import subprocess
import sys
import tempfile
from contextlib import AbstractContextManager
from pathlib import Path

from dropping import drop
from foreign_tables import semicolons
from playwright.sync_api import Browser, Page, ViewportSize, expect
from studio_support import running_browser, with_calibration

from glovecal_models.takes.write_table import write_takes
from glovecal_service.demo.processes import DemoPlace, demo_place, running_capture, running_service
from glovecal_service.first_run.hidden_session import HiddenSession, hidden_session
from glovecal_service.settings import Settings

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "pictures"
MOST_BYTES = 300_000
EFFECT, SEED, SUBJECT, GLOVE = "hysteresis", 7, "pia", "right"
TAKE_S, SMOKE_TAKE_S = 9.0, 5.0
"""Of longer takes, training would start worker processes."""
PAGE: ViewportSize = {"width": 1240, "height": 900}
NARROW: ViewportSize = {"width": 820, "height": 760}
"""Of the two pages that stand side by side in README's picture."""
SHOWN_PX = 640
"""Width of each of them there."""
PATIENCE_MS = 300_000
BESIDE = ("diagnose", "fall")
QUIET = ".q-notification { display: none; } * { caret-color: transparent; }"


def main(arguments: list[str]) -> None:
    """``--smoke``: short takes, and files that do not stay."""
    is_smoke = "--smoke" in arguments
    with tempfile.TemporaryDirectory(prefix="glovecal-picture-") as temporary:
        usual = Path(temporary, "pictures") if is_smoke else FOLDER
        folder = next((Path(name) for name in arguments if not name.startswith("--")), usual)
        hidden = hidden_session(EFFECT, SEED, take_s=SMOKE_TAKE_S if is_smoke else TAKE_S)
        place = demo_place(Path(temporary))
        settings = Settings(data=place.folder / "glovecal-data", zenoh=place.zenoh, port=place.port)
        with running_service(place) as service, running_browser() as browser:
            layout, model = with_calibration(settings, service, hidden, place.folder / "takes", SUBJECT)
            page = browser.new_page(viewport=PAGE, color_scheme="light", reduced_motion="reduce")
            page.set_default_timeout(PATIENCE_MS)
            pictures = Walk(page, f"{place.url}/studio").before_and_after(model)
            pictures |= Walk(page, f"{place.url}/studio").of_a_file(place.folder)
            with streaming(place, hidden, layout):
                pictures["live"] = Walk(page, f"{place.url}/studio").of_a_hand()
            pictures["studio"] = beside(browser, [pictures.pop(f"{name}-narrow") for name in BESIDE])
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in pictures.items():
            if len(content) > MOST_BYTES:
                sys.exit(f"{name}: {len(content)} bytes: a picture is to have {MOST_BYTES} at most")
            (folder / f"{name}.png").write_bytes(content)
            print(f"{folder / f'{name}.png'}: {len(content) // 1000} kB")


def streaming(
    place: DemoPlace, hidden: HiddenSession, layout: str
) -> AbstractContextManager[subprocess.Popen[bytes]]:
    """The glove of the session, which bends and stretches."""
    live = hidden.live(20.0).take
    write_takes([live], place.folder / "live.csv")
    return running_capture(
        place,
        device=f"replay:{place.folder / 'live.csv'}",
        glove=GLOVE,
        subject=SUBJECT,
        wearing=live.wearing,
        options={"layout": layout, "loop": "yes"},
    )


class Walk:
    """From page to page of one running service."""

    def __init__(self, page: Page, studio: str) -> None:
        self._page = page
        self._studio = studio

    def before_and_after(self, model: str) -> dict[str, bytes]:
        """Where the model fails, the effect named, and the fall once it was added."""
        page = self._page
        self._open(f"compare?models={model}")
        page.locator(".stretch").first.click()
        page.locator(".hand-view canvas").first.wait_for()
        page.evaluate("scrollTo(0, 0)")
        found = {"compare": self._still()}
        self._open(f"diagnose?model={model}")
        page.get_by_role("button", name="Diagnose", exact=True).click()
        add = page.get_by_role("button", name=f"Add {EFFECT}").first
        add.wait_for()
        expect(page.locator("#main").get_by_role("progressbar")).to_be_hidden(timeout=PATIENCE_MS)
        found |= self._both("diagnose")
        add.click()
        page.get_by_role("link", name="See the error fall").last.click()
        expect(page.get_by_text("The error falls from").first).to_be_visible(timeout=PATIENCE_MS)
        page.locator("canvas").first.wait_for()
        return found | self._both("fall")

    def of_a_file(self, folder: Path) -> dict[str, bytes]:
        """The ways in, what a dropped file is, and a take of it."""
        page = self._page
        self._open("start")
        found = {"start": self._still()}
        self._open("takes")
        drop(page, semicolons(folder, 6, seconds=12.0))
        page.get_by_label("Whose takes").fill("dora")
        bring = page.get_by_role("button", name="Import 6 takes")
        bring.scroll_into_view_if_needed()
        page.get_by_text("Columns: how they are read").click()
        found["dropped"] = self._still()
        bring.click()
        page.get_by_role("button", name="Train on 6 takes").wait_for()
        found["train"] = self._still()
        page.locator('a[href*="/take?id="]').first.click()
        page.locator("canvas").first.wait_for()
        return found | {"take": self._still()}

    def of_a_hand(self) -> bytes:
        page = self._page
        self._open("live")
        page.locator(".hand-view canvas").first.wait_for()
        expect(page.locator(".state-word").first).to_contain_text("ok", timeout=PATIENCE_MS)
        page.get_by_role("button", name="Raw").click()
        page.wait_for_timeout(6000)  # the strips of readings show the last six seconds
        return self._still()

    def _both(self, name: str) -> dict[str, bytes]:
        """For docs/, and narrow for README."""
        found = {name: self._still()}
        self._page.set_viewport_size(NARROW)
        found[f"{name}-narrow"] = self._still()
        self._page.set_viewport_size(PAGE)
        return found

    def _open(self, name: str) -> None:
        self._page.goto(f"{self._studio}/{name}")
        self._page.wait_for_selector("h1")

    def _still(self) -> bytes:
        self._page.add_style_tag(content=QUIET)
        self._page.wait_for_timeout(1500)
        return self._page.screenshot()


def beside(browser: Browser, pages: list[bytes]) -> bytes:
    """Side by side, as PNG."""
    images = "".join(
        f'<img width="{SHOWN_PX}" src="data:image/png;base64,{base64.b64encode(each).decode()}">'
        for each in pages
    )
    page = browser.new_page(viewport={"width": SHOWN_PX * len(pages) + 24, "height": 100})
    style = "body { margin: 0; display: flex; gap: 24px; align-items: flex-start; background: white; }"
    page.set_content(f"<!doctype html><style>{style}</style>{images}")
    return page.screenshot(full_page=True)


if __name__ == "__main__":
    main(sys.argv[1:])
