"""On a phone's width: no cut columns, cells that say what they are, pages in one line."""

from __future__ import annotations

import pytest
from playwright.sync_api import ViewportSize, expect
from studio_support import Open

pytestmark = pytest.mark.needs_chromium
PHONE: ViewportSize = {"width": 390, "height": 844}
SHARE_OF_THE_SCREEN = 0.12


@pytest.mark.parametrize("name", ["compare", "models", "diagnose", "takes"])
def test_a_row_is_a_card_and_nothing_is_cut(opened: Open, trained: str, name: str) -> None:
    page = opened(f"{name}?models={trained}" if name == "compare" else name).page
    page.set_viewport_size(PHONE)
    if name in ("compare", "models"):
        cell = page.locator(".table-box tbody td").first
        cell.wait_for()
        page.wait_for_function("document.querySelector('.table-box tbody td').dataset.head")
        boxes = page.locator(".table-box")
        for at in range(boxes.count()):
            wide, shown = boxes.nth(at).evaluate("box => [box.scrollWidth, box.clientWidth]")
            assert wide <= shown + 1
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    header = page.locator(".studio-header").bounding_box()
    assert header is not None
    assert header["height"] <= SHARE_OF_THE_SCREEN * PHONE["height"]
    expect(page.locator(".studio-nav [aria-current]")).to_be_in_viewport()
