"""README's picture of the studio, from the running pages: what a glove hides is named, and its error falls.

python3 do.py picture [FILE]     default docs/pictures/studio.png
"""

from __future__ import annotations

import base64
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import Browser, Page, ViewportSize, expect
from studio_support import running_browser, with_calibration

from glovecal_service.demo.processes import demo_place, running_service
from glovecal_service.first_run.hidden_session import hidden_session
from glovecal_service.settings import Settings

FILE = Path(__file__).resolve().parents[2] / "docs" / "pictures" / "studio.png"
MOST_BYTES = 300_000
EFFECT, SEED, SUBJECT = "hysteresis", 7, "pia"
TAKE_S, SMOKE_TAKE_S = 9.0, 5.0
"""Of longer takes, training would start worker processes."""
PAGE: ViewportSize = {"width": 820, "height": 760}
SHOWN_PX = 640
"""Width of each of the two pages in the picture."""
PATIENCE_MS = 300_000
QUIET = ".q-notification { display: none; } * { caret-color: transparent; }"


def main(arguments: list[str]) -> None:
    """``--smoke``: short takes, and a file that does not stay."""
    is_smoke = "--smoke" in arguments
    with tempfile.TemporaryDirectory(prefix="glovecal-picture-") as temporary:
        usual = Path(temporary, "studio.png") if is_smoke else FILE
        file = next((Path(name) for name in arguments if not name.startswith("--")), usual)
        hidden = hidden_session(EFFECT, SEED, take_s=SMOKE_TAKE_S if is_smoke else TAKE_S)
        place = demo_place(Path(temporary))
        settings = Settings(data=place.folder / "glovecal-data", zenoh=place.zenoh, port=place.port)
        with running_service(place) as service, running_browser() as browser:
            _, model = with_calibration(settings, service, hidden, place.folder / "takes", SUBJECT)
            pages = walk(browser, f"{place.url}/studio", model)
            content = beside(browser, pages)
        if len(content) > MOST_BYTES:
            sys.exit(f"{len(content)} bytes: the picture is to have {MOST_BYTES} at most")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)
        print(f"{file}: {len(content) // 1000} kB, Diagnose and Error fall")


def walk(browser: Browser, studio: str, model: str) -> list[bytes]:
    """Diagnose with the effect named, and the fall once it was added."""
    page = browser.new_page(viewport=PAGE, color_scheme="light", reduced_motion="reduce")
    page.goto(f"{studio}/diagnose?model={model}")
    page.get_by_role("button", name="Diagnose", exact=True).click()
    add = page.get_by_role("button", name=f"Add {EFFECT}").first
    add.wait_for(timeout=PATIENCE_MS)
    expect(page.locator("#main").get_by_role("progressbar")).to_be_hidden(timeout=PATIENCE_MS)
    found = [still(page)]
    add.click()
    fall = page.get_by_role("link", name="See the error fall")
    fall.wait_for(timeout=PATIENCE_MS)
    fall.click()
    expect(page.get_by_text("The error falls from").first).to_be_visible(timeout=PATIENCE_MS)
    page.locator("canvas").first.wait_for()
    return [*found, still(page)]


def still(page: Page) -> bytes:
    page.add_style_tag(content=QUIET)
    page.wait_for_timeout(1500)
    return page.screenshot()


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
