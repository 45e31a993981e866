"""Pages of the studio as tests, the bench and the picture of README open them."""

from __future__ import annotations

import json
import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event
from typing import Any
from unittest.mock import patch

import numpy as np
import zenoh
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect, sync_playwright
from realtime_support import WireGlove

from glovecal_client.capture.cyberglove import find_port
from glovecal_client.rest import RestClient
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_service.first_run.hidden_session import HiddenSession
from glovecal_service.questions.making import keep
from glovecal_service.serve import web
from glovecal_service.settings import Settings
from glovecal_service.store import Store

FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--enable-unsafe-swiftshader",
)  # fmt: skip

COLOURS = "color-contrast"
"""All that another colour scheme changes."""

MOST_LOOKS = 10
PATIENCE_MS = 120_000
"""For whatever a page is to show: on a busy computer service, browser and drawing wait in turn."""

SEED = 1
"""Of what ``web_that_draws`` hides."""

STREAMING = {"state": "streaming", "sentence": "", "rate_hz": 60.0}


NO_CHROMIUM = "Chromium is not installed (Debian: apt-get install chromium-headless-shell)"


def installed_chromium() -> str | None:
    """Chromium without its windows, where it is installed: a page opens in a third of the time."""
    return shutil.which("chromium-headless-shell") or shutil.which("chromium")


@contextmanager
def running_browser(*flags: str) -> Iterator[Browser]:
    """The Chromium of this computer, headless; WebGL is drawn by the processor."""
    chromium = installed_chromium()
    if chromium is None:
        raise FileNotFoundError(NO_CHROMIUM)
    expect.set_options(timeout=PATIENCE_MS)
    with sync_playwright() as running:
        browser = running.chromium.launch(executable_path=chromium, args=[*FLAGS, *flags])
        yield browser
        browser.close()


def web_that_draws(settings: Settings, stopped: Event, started: Callable[[], None]) -> None:
    """The web process, with what it hides known to the test. This computer's ports are nobody's business."""
    with patch("secrets.randbelow", return_value=SEED), patch.object(find_port, "_listed_ports", dict):
        web(settings, stopped, started)


@dataclass
class Opened:
    """A page of the studio, and what went wrong on it."""

    page: Page
    complaints: list[str] = field(default_factory=list)
    """Console errors, uncaught errors."""
    asked: list[str] = field(default_factory=list)
    """Addresses of all requests."""


Open = Callable[..., Opened]


def serious(page: Page, *rules: str) -> list[str]:
    """What axe-core finds that keeps somebody from using the page, or makes it harder: findings of moderate,
    serious or critical impact.

    Of ``rules`` alone where they are given. Colours that fade, under the mouse or after a click, are waited
    for.
    """
    page.mouse.move(0, 0)
    findings, looks = _findings(page, *rules), 1
    while looks < MOST_LOOKS and any(item.startswith(COLOURS) for item in findings):
        page.wait_for_timeout(300)
        findings, looks = _findings(page, *rules), looks + 1
    return findings


def _findings(page: Page, *rules: str) -> list[str]:
    only = {"runOnly": {"type": "rule", "values": [*rules]}} if rules else {}
    # "Connection lost" is NiceGUI's own, outside our regions, and comes up wherever a computer is busy.
    context = {"exclude": [["#popup"]]}
    found = Axe().run(page, context, {"resultTypes": ["violations"], **only}).response["violations"]
    return [
        f"{item['id']} ({item['impact']}): {item['nodes'][0]['html'][:200]}"
        for item in found
        if item["impact"] != "minor"
    ]


WITHOUT_FOCUS = """() => {
  const look = each => [each, each.closest(".q-field__control")].filter(Boolean)
    .map(one => { const style = getComputedStyle(one); return style.outline + style.boxShadow; }).join();
  const focusable = "a[href], button, input, select, textarea, summary, audio[controls], [tabindex]";
  return [...document.querySelectorAll(focusable)]
    .filter(each => each.tabIndex >= 0 && !each.disabled)
    .filter(each => each.checkVisibility({ visibilityProperty: true }))
    .filter(each => {
      document.activeElement.blur();
      const before = look(each);
      each.focus({ preventScroll: true, focusVisible: true });
      return document.activeElement === each && look(each) === before;
    })
    .map(each => each.outerHTML.slice(0, 200));
}"""


def without_focus(page: Page) -> list[str]:
    """What does not show that the keyboard is on it."""
    page.keyboard.press("Tab")  # whoever uses a mouse is not shown where the keyboard would be
    return page.evaluate(WITHOUT_FOCUS)


def with_calibration(
    settings: Settings, client: RestClient, hidden: HiddenSession, folder: Path, subject: str
) -> tuple[str, str]:
    """Import a session; layout, and id of an LMC-GPR model trained here: no worker needs to start for it.

    A linear model and readings scaled to angles are there for comparison.
    """
    training, test = hidden.write(folder)
    client.post("/subjects", {"name": subject})
    learned = client.upload_takes(training, subject=subject)
    client.upload_takes(test, subject=subject, layout=learned["layout"])
    made = ""
    with Store.open(settings) as store:
        records = [store.takes.get(take["id"]) for take in learned["takes"]]
        takes, layout = (
            [store.takes.load(record.id) for record in records],
            store.layouts.get(learned["layout"]),
        )
        for method in ("raw", "linear", "lmc_gpr"):
            chosen = TrainingSettings(method=method, samples=300, folds=2)
            hashes = [record.artifact for record in records]
            model = train(takes, layout, subject, chosen, take_hashes=hashes)
            made = keep(store, model, learned["layout"], records, chosen, {}, activate=True).id
    return learned["layout"], made


@contextmanager
def moving(
    session: zenoh.Session,
    settings: Settings,
    name: str,
    subject: str | None,
    acts: set[str] | None = None,
    **meta: Any,
) -> Iterator[WireGlove]:
    """A glove that bends and stretches, 60 frames a second, and says once a second that it streams.

    ``acts`` changes what it does: ``dropped`` a sensor that reads zero, ``silent`` no frames, ``still`` a
    hand that does not move, ``one`` only its first sensor that does.
    """
    glove = WireGlove(session, settings, name, subject=subject)
    stopped, acts = threading.Event(), acts if acts is not None else set()

    def send() -> None:
        at = 0
        while not stopped.wait(1 / 60):
            if at % 30 == 0:
                glove.say_meta(**meta)
                session.put(glove.keys.status, json.dumps(STREAMING))
            bend = 140.0 + 60.0 * np.sin(at / 20.0)
            if "silent" not in acts:
                others = 140.0 if acts & {"still", "one"} else bend
                first = 140.0 if "still" in acts else bend
                glove.send((0.0 if "dropped" in acts else first, others, others))
            at += 1

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield glove
    finally:
        stopped.set()
        thread.join()
