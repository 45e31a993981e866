"""The site is built strictly, from this code, and needs no network."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import NoReturn

import pytest
import typer.main
from playwright.sync_api import expect, sync_playwright

from glovecal_service.cli.command import some_verbs
from glovecal_service.rest.app import create_app
from glovecal_service.settings import Settings

ROOT = Path(__file__).resolve().parents[2]
OFFLINE = {"UV_OFFLINE": "1", "PIP_NO_INDEX": "1", "HTTPS_PROXY": "http://127.0.0.1:9"}
LOADED = {"img": "src", "script": "src", "link": "href", "iframe": "src", "source": "src"}


class Page(HTMLParser):
    """What a page loads by itself, and the ids in it."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.ids: set[str] = set()
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.ids.add(values.get("id") or "")
        loaded = values.get(LOADED.get(tag, ""))
        if loaded:
            self.loads.append(loaded)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory, not_here: Callable[[str], NoReturn]) -> Path:
    """As ``do.py docs`` builds it: a warning, such as a link that leads nowhere, is an error."""
    if not (ROOT / ".venv").is_dir() or not (ROOT / ".tools" / "uv").is_dir():
        not_here("there is no .venv (python3 do.py test makes it)")
    folder = tmp_path_factory.mktemp("documentation") / "site"
    command = [sys.executable, str(ROOT / "do.py"), "docs", str(folder), "--smoke"]
    done = subprocess.run(
        command, cwd=ROOT, env=os.environ | OFFLINE, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert done.stdout == f"{len(list(folder.rglob('*.html')))} pages built.\n"
    return folder


def test_pages_load_nothing_from_a_network(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert len(pages) > 15
    for page in pages:
        for loaded in Page(page.read_text()).loads:
            assert not re.match(r"(https?:)?//", loaded), f"{page.name} loads {loaded}"
            if not loaded.startswith(("data:", "#")):
                assert (page.parent / loaded.partition("?")[0]).exists(), f"{page.name} lacks {loaded}"
    for style in site.rglob("*.css"):
        assert not re.search(r"(@import|url\()\s*[\"']?(https?:)?//", style.read_text()), style.name


def test_the_folder_opens_on_the_front_page(site: Path) -> None:
    leads = (site / "index.html").read_text()
    (target,) = re.findall(r"url=([\w.]+)", leads)
    assert (site / target).exists()


@pytest.mark.needs_chromium
def test_the_search_works_on_pages_opened_as_files(site: Path, not_here: Callable[[str], NoReturn]) -> None:
    chromium = shutil.which("chromium")
    if chromium is None:
        not_here("Chromium is not installed (Debian: apt-get install chromium)")
    complaints: list[str] = []
    with sync_playwright() as running:
        browser = running.chromium.launch(executable_path=chromium, args=["--headless", "--no-sandbox"])
        page = browser.new_page()
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto((site / "docs" / "effects.html").as_uri())
        page.get_by_role("textbox", name="Search").fill("hysteresis")
        page.get_by_role("textbox", name="Search").press("Enter")
        expect(page.get_by_text(re.compile("found [0-9]+ pages"))).to_be_visible(timeout=120_000)
        expect(page.get_by_role("link", name="The blind study").last).to_be_visible()
        browser.close()
    assert complaints == []


def test_every_command_has_its_entry(site: Path) -> None:
    page = (site / "docs" / "commands.html").read_text()
    ids = Page(page).ids
    paths = [path for path, _ in _commands(typer.main.get_command(some_verbs()), ("glovecal",))]
    assert len(paths) > 40
    assert {"-".join(path) for path in paths} <= ids
    assert "Options of replay:" in page  # put together when help is asked for


def test_every_route_has_its_entry(site: Path, tmp_path: Path) -> None:
    document = create_app(Settings(data=tmp_path)).openapi()
    page = (site / "docs" / "rest.html").read_text()
    headings = set(re.findall(r"<h3>([A-Z]+ /[^<]*)<", page))
    routes = {f"{method.upper()} {path}" for path, methods in document["paths"].items() for method in methods}
    assert len(routes) > 40
    assert routes == headings
    schemas = {re.sub("[^a-z0-9]+", "-", name.lower()) for name in document["components"]["schemas"]}
    assert {f"schema-{name}" for name in schemas} <= Page(page).ids


def _commands(command, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], object]]:
    for name, child in getattr(command, "commands", {}).items():
        yield (*path, name), child
        yield from _commands(child, (*path, name))
