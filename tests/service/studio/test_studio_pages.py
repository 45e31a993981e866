"""Every page in a real browser: it says what it is, asks nobody else, and everybody can use it."""

from __future__ import annotations

import httpx
import pytest
from playwright.sync_api import expect
from studio_support import COLOURS, Open, serious, without_focus

pytestmark = pytest.mark.needs_chromium
PAGES = {
    "start": "Start",
    "live": "Live",
    "capture": "Capture",
    "cameras": "Cameras",
    "takes": "Takes",
    "compare": "Compare",
    "diagnose": "Diagnose",
    "fall": "Error fall",
    "models": "Models and subjects",
    "effects": "Effects",
}
LAST_THERE = {"compare": ".stretch"}
"""What a page shows when all of it is there, where that takes a moment."""
LEAST_TARGET_PX = 44


@pytest.mark.parametrize("name", PAGES)
def test_everybody_can_use_it(opened: Open, address: str, trained: str, name: str) -> None:
    seen = opened(f"{name}?models={trained}" if name == "compare" else name)
    page = seen.page
    expect(page.locator("h1")).to_have_text([PAGES[name]])
    assert page.locator("html").get_attribute("lang") == "en-US"
    link = page.get_by_role("navigation", name="Pages").locator(f'a[href^="/studio/{name}"]')
    assert link.get_attribute("aria-current") == "page"
    page.locator(LAST_THERE.get(name, "h1")).first.wait_for()
    page.wait_for_timeout(500)
    assert serious(page) == []
    page.emulate_media(color_scheme="dark")
    page.wait_for_timeout(500)
    assert "body--dark" in (page.locator("body").get_attribute("class") or "")
    assert serious(page, COLOURS) == []
    assert without_focus(page) == []
    page.set_viewport_size({"width": 390, "height": 844})
    assert serious(page) == []
    page.emulate_media(color_scheme="light")
    page.wait_for_timeout(500)
    assert serious(page, COLOURS) == []
    navigation = page.locator("header").bounding_box()
    assert navigation is not None
    assert navigation["height"] < 844 / 4
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    small = page.evaluate(
        """least => [...document.querySelectorAll("#main button, nav a, header button")]
            .map(each => [each.getBoundingClientRect(), each.innerText])
            .filter(([box]) => box.width && (box.height < least || box.width < least))
            .map(([box, text]) => `${text} ${box.width}x${box.height}`)""",
        LEAST_TARGET_PX,
    )
    assert small == []
    asked = [url for url in seen.asked if url.startswith("http")]
    assert all(url.startswith(address) for url in asked)
    assert seen.complaints == []


def test_another_site_can_neither_open_a_page_nor_hear_a_glove(address: str) -> None:
    foreign = {"Origin": "http://evil.example", "Sec-Fetch-Site": "cross-site"}
    upgrade = {
        "Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
    }  # fmt: skip
    for path in ("/studio/feed/right-hand", "/studio/_nicegui_ws/socket.io/?EIO=4&transport=websocket"):
        assert httpx.get(f"{address}{path}", headers=foreign | upgrade).status_code == 403
    assert httpx.get(f"{address}/studio/live", headers={"Host": "evil.example"}).status_code == 421
    policy = httpx.get(f"{address}/studio/live").headers["content-security-policy"]
    assert "frame-ancestors 'none'" in policy
    assert "default-src 'self'" in policy
