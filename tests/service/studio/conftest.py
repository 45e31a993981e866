"""A running service with its studio, on data that were stored before, and a real browser."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, NoReturn

import httpx
import pytest
from playwright.sync_api import Browser, ViewportSize
from playwright.sync_api import Error as PlaywrightError

sys.path.insert(0, str(Path(__file__).parent))

from realtime_support import eventually, free_endpoint, part_of_service, store_model
from studio_support import NO_CHROMIUM, PATIENCE_MS, Open, Opened, installed_chromium, running_browser
from unpacked_example import unpacked_example

from glovecal_service.serve import real_time, web
from glovecal_service.settings import Settings
from glovecal_service.store import Store

DESKTOP: ViewportSize = {"width": 1280, "height": 800}
TABLET: ViewportSize = {"width": 768, "height": 1024}
HARMLESS = "GPU stall due to ReadPixels"
TELL_OF_THE_LINE = """window.socket && ["connect", "disconnect", "connect_error"].forEach(
  name => socket.on(name, about => console.info("line to the service:", name, String(about))))"""


@pytest.fixture(scope="package")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Settings:
    data = unpacked_example(tmp_path_factory.mktemp("studio"))
    port = int(free_endpoint().rpartition(":")[2])
    return Settings(data=data, zenoh=free_endpoint(), port=port, workers=1)


@pytest.fixture(scope="package")
def model(settings: Settings) -> str:
    """The id of a linear model of subject anna for three sensors."""
    store = Store.open(settings)
    try:
        return store_model(store, "anna", degrees_per_count=0.5)
    finally:
        store.close()


@pytest.fixture(scope="package")
def address(settings: Settings, model: str) -> Iterator[str]:
    """Of the service; its real-time and web processes run."""
    with ExitStack() as running:
        for work in (real_time, web):
            running.enter_context(part_of_service(work, settings))
        url = f"http://127.0.0.1:{settings.port}"
        assert httpx.get(f"{url}/v1/health/live").is_success
        yield url


@pytest.fixture(scope="package")
def trained(address: str) -> str:
    """The id of a model whose takes are stored."""
    found = httpx.get(f"{address}/v1/models").json()
    return next(each["id"] for each in found if each["facts"].get("takes"))


@pytest.fixture
def long_job(address: str, trained: str) -> Iterator[Callable[[], str]]:
    """Starts a job of minutes that stores nothing and ends with the test, and gives its id. Behind two of
    them every other job waits."""
    started = []

    def start() -> str:
        model = httpx.get(f"{address}/v1/models/{trained}").json()
        asked = f"{address}/v1/subjects/{model['subject']}/detectability"
        body = {"layout": model["layout"], "trials": 50, "seed": len(started)}
        started.append(httpx.post(asked, json=body).raise_for_status().json()["id"])
        return started[-1]

    def ended(job: str) -> bool:
        return httpx.get(f"{address}/v1/jobs/{job}").json()["state"] == "cancelled"

    yield start
    for job in started:
        httpx.post(f"{address}/v1/jobs/{job}/cancel")
        eventually(lambda job=job: ended(job), f"the end of {job}")


@pytest.fixture(scope="package")
def browser(not_here: Callable[[str], NoReturn]) -> Iterator[Browser]:
    if installed_chromium() is None:
        not_here(NO_CHROMIUM)
    with running_browser("--webgl-antialiasing-mode=none") as browser:
        yield browser


@pytest.fixture(scope="module", autouse=True)
def _nothing_left_behind() -> Iterator[None]:
    """What earlier tests left in cycles, zenoh's queries among it, is freed here: freed on the stack of
    Playwright's greenlet it once ended the process."""
    gc.collect()
    yield
    gc.collect()


@pytest.fixture
def opened(browser: Browser, address: str) -> Iterator[Open]:
    """``opened("live")``: the page once its heading is there; ``at`` is another service's address. On a
    ``tablet`` there is no mouse, and it is held upright. Nothing moves by itself: what moves is half of the
    drawing, and what unfolds can be clicked a moment before it stands still. A failed test shows what the
    browser logged and how its line to the service stood."""
    contexts = []

    def open_page(name: str, at: str = address, *, tablet: bool = False) -> Opened:
        # A quarter of the pixels each way: the processor draws them all.
        context = browser.new_context(
            viewport=TABLET if tablet else DESKTOP, has_touch=tablet, is_mobile=tablet,
            device_scale_factor=0.25, color_scheme="light", reduced_motion="reduce",
        )  # fmt: skip
        context.set_default_timeout(PATIENCE_MS)
        contexts.append(context)
        seen = Opened(context.new_page())

        def complain(message: Any) -> None:
            print("browser:", message.type, message.text)
            if message.type == "error" and HARMLESS not in message.text:
                seen.complaints.append(message.text)

        seen.page.on("console", complain)
        seen.page.on("pageerror", lambda error: seen.complaints.append(str(error)))
        seen.page.on("request", lambda request: seen.asked.append(request.url))
        seen.page.goto(f"{at}/studio/{name}")
        seen.page.wait_for_selector("h1")
        # what is clicked before is lost: the service does not know the page yet
        seen.page.wait_for_function("!window.socket || window.did_handshake === true")
        seen.page.evaluate(TELL_OF_THE_LINE)
        return seen

    yield open_page
    for context in contexts:
        for page in context.pages:
            with suppress(PlaywrightError):  # a page that was left or crashed
                print("line to the service:", page.url, page.evaluate("window.socket && socket.connected"))
        context.close()
