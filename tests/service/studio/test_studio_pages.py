"""Every page in a real browser: it says what it is, asks nobody else, and everybody can use it."""

from __future__ import annotations

import httpx
import pytest
from axe_playwright_python.sync_playwright import Axe
from studio_support import Open

pytestmark = pytest.mark.needs_chromium
PAGES = {
    "live": "Live",
    "diagnose": "Diagnose",
    "fall": "Error fall",
    "models": "Models and subjects",
    "effects": "Effects",
}
LEAST_TARGET_PX = 44


def serious(page) -> list[str]:
    found = Axe().run(page).response["violations"]
    return [
        f"{item['id']}: {item['nodes'][0]['html'][:200]}"
        for item in found
        if item["impact"] in ("serious", "critical")
    ]


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_nothing_is_in_anybodys_way(opened: Open, name: str, dark: bool) -> None:
    seen = opened(name, dark=dark)
    seen.page.wait_for_timeout(500)
    assert serious(seen.page) == []
    assert seen.page.locator("h1").all_inner_texts() == [PAGES[name]]
    assert seen.page.locator("html").get_attribute("lang") == "en-US"
    assert seen.page.locator(f'nav a[href="/studio/{name}"]').get_attribute("aria-current") == "page"


@pytest.mark.parametrize("name", PAGES)
def test_it_fits_a_phone_and_asks_nobody_else(opened: Open, address: str, name: str) -> None:
    seen = opened(name, size=(390, 844))
    seen.page.wait_for_timeout(500)
    assert seen.page.evaluate("document.documentElement.scrollWidth") <= 390
    small = seen.page.evaluate(
        """least => [...document.querySelectorAll("#main button, nav a, header button")]
            .map(each => [each.getBoundingClientRect(), each.innerText])
            .filter(([box]) => box.width && (box.height < least || box.width < least))
            .map(([box, text]) => `${text} ${box.width}x${box.height}`)""",
        LEAST_TARGET_PX,
    )
    assert small == []
    assert {url.partition("//")[2].partition("/")[0] for url in seen.asked if url.startswith("http")} == {
        address.partition("//")[2]
    }
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
