"""``/`` and ``/docs`` in a real browser: they render, and nothing but the service is asked for anything."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from typing import NoReturn

import httpx
import pytest

from glovecal_service.settings import Settings


@dataclass(frozen=True)
class Seen:
    """What a browser made of a page."""

    html: str
    asked: set[str]
    """Addresses that the page, or what it loaded, asked for."""
    complaints: list[str]


@pytest.fixture(scope="module")
def look(
    not_here: Callable[[str], NoReturn], tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], Seen]:
    """Opens an address in headless Chromium; without one the test is skipped, or fails if it is required."""
    chromium = shutil.which("chromium")
    if chromium is None:
        not_here("Chromium is not installed (Debian: apt-get install chromium)")

    def opened(url: str) -> Seen:
        folder = tmp_path_factory.mktemp("chromium")
        done = subprocess.run(
            [
                chromium, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run",
                "--disable-background-networking", f"--user-data-dir={folder / 'profile'}",
                f"--log-net-log={folder / 'net.json'}", "--enable-logging=stderr",
                "--window-size=400,800", "--virtual-time-budget=20000", "--dump-dom", url,
            ],
            capture_output=True, text=True, check=True, timeout=300,
        )  # fmt: skip
        origin = str(httpx.URL(url).copy_with(path="/")).rstrip("/")
        events = json.loads((folder / "net.json").read_text())["events"]
        params = [event.get("params", {}) for event in events]
        asked = {one["url"] for one in params if one.get("initiator") == origin and "url" in one}
        complaints = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
        return Seen(done.stdout, asked, complaints)

    return opened


@pytest.fixture(scope="module")
def address(serve: Callable[..., str], tmp_path_factory: pytest.TempPathFactory) -> str:
    url = serve(Settings(data=tmp_path_factory.mktemp("front") / "data"))
    httpx.post(f"{url}/v1/subjects", json={"name": "anna"}).raise_for_status()
    return url


def test_the_front_page_says_what_this_is(address: str) -> None:
    answer = httpx.get(f"{address}/")
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert '<a href="docs">API reference</a>' in answer.text
    assert re.search(r"<p>Glovecal 0\.\d", answer.text)
    assert re.search(r'>state</td><td class="text">gloves are not served<', answer.text)
    assert re.search(r'>subjects</td><td class="text">1<', answer.text)


def test_the_guards_hold_here_too(address: str) -> None:
    for path in ("/", "/docs", "/docs/start.js", "/docs/swagger-ui.css"):
        assert httpx.get(address + path).status_code == 200
        assert httpx.get(address + path, headers={"Host": "evil.example"}).status_code == 421
        refused = httpx.post(address + path, headers={"Origin": address})
        assert (refused.status_code, refused.headers["allow"]) == (405, "GET")
    for path in ("/docs/redoc.standalone.js", "/docs/..%2fcore.py", "/docs/"):
        assert httpx.get(address + path).status_code in (404, 422)


@pytest.mark.needs_chromium
def test_both_render_in_a_browser_and_ask_nobody_else(address: str, look: Callable[[str], Seen]) -> None:
    front, reference = look(f"{address}/"), look(f"{address}/docs")
    assert "API reference" in front.html
    document = httpx.get(f"{address}/v1/openapi.json").json()
    operations = [one["summary"] for path in document["paths"].values() for one in path.values()]
    assert len(re.findall(r'class="opblock ', reference.html)) == len(operations) > 60
    assert "Import a take table" in reference.html
    assert f"{address}/v1/openapi.json" in reference.asked
    assert all(url.startswith(address) for url in front.asked | reference.asked)
    assert front.complaints == reference.complaints == []
