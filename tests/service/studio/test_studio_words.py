"""Words of the glossary are explained where they stand on a page, under the pointer and behind one button."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect
from realtime_support import eventually
from studio_support import Open

from glovecal_client.rest import RestClient

pytestmark = pytest.mark.needs_chromium
DOCS = Path(__file__).resolve().parents[3] / "docs"
MARKED = """() => [...(CSS.highlights.get("words-of-the-glossary") ?? [])]
    .map(range => range.toString().toLowerCase())"""


@pytest.fixture(scope="module")
def meanings() -> dict[str, str]:
    sys.path.insert(0, str(DOCS))
    try:
        import glossary_words

        assert glossary_words.WORDS.read_text(encoding="utf-8") == glossary_words.written(), (
            "python3 docs/glossary_words.py writes it"
        )
        return glossary_words.words()
    finally:
        sys.path.remove(str(DOCS))


def unexplained(page: Page, meanings: dict[str, str]) -> list[str]:
    """Words of the glossary that can be read on the page, also in the plural, and are not marked."""
    text = " ".join(page.evaluate("document.querySelector('#main').innerText").lower().split())
    marked = {re.sub(r"[-\s]+", " ", each) for each in page.evaluate(MARKED)}
    standing = {
        word.lower().replace("-", " ")
        for word in meanings
        if re.search(rf"(?<![\w-]){re.escape(word.lower())}s?(?![\w-])", text)
    }
    return sorted(word for word in standing if not any(word in each for each in marked))


@pytest.mark.parametrize(
    "name",
    ["start", "live", "capture", "takes", "cameras", "compare", "diagnose", "fall", "models", "effects"],
)
def test_no_word_stands_on_a_page_without_its_meaning(
    opened: Open, meanings: dict[str, str], name: str
) -> None:
    page = opened(name).page
    page.get_by_role("button", name="Words on this page").wait_for()
    eventually(lambda: not unexplained(page, meanings), "every word that stands there is marked")


def test_a_word_is_explained_under_the_pointer_and_in_the_list(
    opened: Open, address: str, meanings: dict[str, str]
) -> None:
    with RestClient(address) as client:
        models = client.get("/models")
    corrected = next(each["id"] for each in models if each["effects"])
    page = opened(f"fall?model={corrected}").page
    page.get_by_text("noise floor").first.wait_for()
    page.wait_for_function(
        f"({MARKED})().includes('noise floor')",
    )
    place = page.evaluate(
        """() => {
            for (const range of CSS.highlights.get("words-of-the-glossary"))
                if (range.toString().toLowerCase() === "noise floor") {
                    const box = range.getBoundingClientRect();
                    return {x: box.x + box.width / 2, y: box.y + box.height / 2};
                }
        }"""
    )
    page.mouse.move(**place)
    expect(page.get_by_role("tooltip")).to_contain_text(meanings["Noise floor"])
    page.get_by_role("button", name="Words on this page").click()
    expect(page.get_by_role("dialog", name="Words on this page")).to_contain_text(meanings["Noise floor"])
