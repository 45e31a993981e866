"""Pages of the studio as tests, the bench and the picture of README open them."""

from __future__ import annotations

import json
import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import zenoh
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect, sync_playwright
from realtime_support import WireGlove

from glovecal_client.rest import RestClient
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_service.demo.hidden_session import HiddenSession
from glovecal_service.jobs.child_record import artifact_array, keep_child
from glovecal_service.settings import Settings
from glovecal_service.store import Store

FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--enable-unsafe-swiftshader",
)  # fmt: skip

PATIENCE_MS = 120_000
"""For whatever a page is to show: on a busy computer service, browser and drawing wait in turn."""

STREAMING = {"state": "streaming", "sentence": "", "rate_hz": 60.0}


@contextmanager
def running_browser(*flags: str) -> Iterator[Browser]:
    """The Chromium of this computer, headless; WebGL is drawn by the processor."""
    chromium = shutil.which("chromium")
    if chromium is None:
        raise FileNotFoundError("Chromium is not installed (Debian: apt-get install chromium)")
    expect.set_options(timeout=PATIENCE_MS)
    with sync_playwright() as running:
        browser = running.chromium.launch(executable_path=chromium, args=[*FLAGS, *flags])
        yield browser
        browser.close()


@dataclass
class Opened:
    """A page of the studio, and what went wrong on it."""

    page: Page
    complaints: list[str] = field(default_factory=list)
    """Console errors, uncaught errors."""
    asked: list[str] = field(default_factory=list)
    """Addresses of all requests."""


Open = Callable[..., Opened]


def serious(page: Page) -> list[str]:
    """What axe-core finds that keeps somebody from using the page: findings of serious or critical impact."""
    found = Axe().run(page).response["violations"]
    return [
        f"{item['id']}: {item['nodes'][0]['html'][:200]}"
        for item in found
        if item["impact"] in ("serious", "critical")
    ]


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
            made = keep_child(
                store, artifact_array(model), learned["layout"], records, chosen, {}, activate=True
            ).id
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

    ``acts`` changes what it does: ``dropped`` a sensor that reads zero, ``silent`` no frames.
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
                glove.send((0.0 if "dropped" in acts else bend, bend, bend))
            at += 1

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield glove
    finally:
        stopped.set()
        thread.join()
