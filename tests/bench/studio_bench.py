"""The studio's Live page, measured: what a browser shows, and what pages cost service and pose stream.

    python tests/bench/studio_bench.py [--minutes M] [--quick] [--smoke] [--json FILE]

Chromium has one core, the service (real time and web) another; its WebGL is drawn by the processor. Two
gloves of 18 sensors and 22 rotations send 120 frames a second. Ages are what poses state: from the service's
receipt of a frame to its pose. A page's growth is that of its JavaScript heap after a collection.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import operator
import os
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Browser, Page
from realtime_support import free_endpoint, part_of_service
from streaming_bench import random_model
from streaming_load import Load, drive
from studio_support import NO_CHROMIUM, installed_chromium, running_browser

from glovecal_client.keys import GloveKeys
from glovecal_client.session import open_client
from glovecal_models.calibration.artifact import dump
from glovecal_models.worker_processes import pin_blas_to_one_thread
from glovecal_service.serve import real_time, web
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store

GLOVES, RATE_HZ, PEOPLE = 2, 120.0, 2
PAGES = 3
SETTLES_S = 2.0
"""Left out at the start of a run: the page builds its hands."""
UPDATES = """() => [...document.querySelectorAll(".hand-view")]
    .map(view => getElement(view.id.slice(1)).drawn().updates)"""
TARGETS = (
    ("updates_hz", ">=", 25.0, "updates of a live hand a second"),
    ("page_core_percent", "<=", 8.0, "% of one core of the service for an open page"),
    ("age_effect_ms", "<=", 2.0, f"ms more at the 99th percentile of poses' age with {PAGES} pages open"),
    ("growth_mb", "<=", 20.0, "MB growth of a page with two gloves"),
    ("first_s", "<=", 2.0, "s until a page shows its hands"),
)
COMPARED: dict[str, Callable[[float, float], bool]] = {"<=": operator.le, ">=": operator.ge}


@dataclass(frozen=True)
class Run:
    """What one stretch of streaming came to."""

    pages: int
    age_p99_ms: float
    web_core: float
    """Share of one core that the web process took."""
    updates_hz: float
    """Of the slowest hand of all pages; NaN without a page."""
    growth_mb: float
    first_s: float
    """Until the slowest page had its gloves' hands; NaN without a page."""


class Bench:
    """A running service with its gloves, and a browser."""

    def __init__(self, settings: Settings, web_process: int, browser: Browser) -> None:
        self._settings = settings
        self._web = web_process
        self._browser = browser

    def run(self, pages: int, seconds: float) -> Run:
        """Stream for ``seconds`` with so many Live pages open."""
        load = Load(self._settings.zenoh, self._settings.site, GLOVES, PEOPLE, RATE_HZ, seconds)
        with ExitStack() as kept:
            driver = kept.enter_context(_driver(load))
            opened, firsts = [], []
            for _ in range(pages):
                began = time.monotonic()
                opened.append(kept.enter_context(self._page()))
                firsts.append(time.monotonic() - began)
            driver.send("start")
            time.sleep(SETTLES_S)
            heaps, counts = [_heap_mb(page) for page in opened], [page.evaluate(UPDATES) for page in opened]
            began, cpu_s = time.monotonic(), _cpu_s(self._web)
            time.sleep(max(0.5, seconds - SETTLES_S - (time.monotonic() - began) - 0.5))
            passed, spent_s = time.monotonic() - began, _cpu_s(self._web) - cpu_s
            rates = [
                (after - before) / passed
                for page, counted in zip(opened, counts, strict=True)
                for before, after in zip(counted, page.evaluate(UPDATES), strict=True)
            ]
            grown = [_heap_mb(page) - heap for page, heap in zip(opened, heaps, strict=True)]
            driver.recv()
            driver.send("enough")
            _, age_ms = driver.recv()
        nothing = float("nan")
        run = Run(
            pages,
            float(np.percentile(age_ms, 99)),
            spent_s / passed,
            min(rates, default=nothing),
            max(grown, default=nothing),
            max(firsts, default=nothing),
        )
        print(
            f"{pages} pages, {seconds:.0f} s: poses' age p99 {run.age_p99_ms:.2f} ms, web process "
            f"{100 * run.web_core:.1f} % of a core, slowest hand {run.updates_hz:.1f} updates/s, "
            f"growth {run.growth_mb:.1f} MB, opened in {run.first_s:.1f} s",
            flush=True,
        )
        return run

    @contextmanager
    def _page(self) -> Iterator[Page]:
        page = self._browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(f"http://127.0.0.1:{self._settings.port}/studio/live", timeout=120_000)
        # a page that is too slow to be heard of is loaded again by itself
        page.wait_for_function("window.did_handshake === true", timeout=120_000)
        page.locator(".hand-view canvas").nth(GLOVES - 1).wait_for(timeout=120_000)
        try:
            yield page
        finally:
            page.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=1.0, help="how long the growth of a page is watched")
    parser.add_argument("--quick", action="store_true", help="shorter runs")
    parser.add_argument(
        "--smoke", action="store_true", help="only whether it runs: no figure is worth reading"
    )
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    if installed_chromium() is None:
        print(f"{NO_CHROMIUM}: the studio was not measured.")
        return
    pin_blas_to_one_thread()
    seconds = 4.0 if options.smoke else 8.0 if options.quick else 20.0
    with tempfile.TemporaryDirectory(prefix="glovecal-bench-") as folder:
        port = int(free_endpoint().rpartition(":")[2])
        settings = Settings(data=Path(folder), zenoh=free_endpoint(), port=port)
        figures = measure(settings, seconds, 0.0 if options.smoke else 60.0 * options.minutes)
    show(figures)
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1))


def measure(settings: Settings, seconds: float, watched_s: float) -> dict[str, Any]:
    """Without a page, with one, with three; then one page for ``watched_s``."""
    _store_models(settings)
    cores = sorted(os.sched_getaffinity(0))
    with ExitStack() as running:
        with _on({cores[-1]}):
            running.enter_context(part_of_service(real_time, settings))
            process = running.enter_context(part_of_service(web, settings))
        running.enter_context(_said_to_stream(settings))
        with _on({cores[0]}):
            browser = running.enter_context(running_browser())
        assert process.pid is not None
        bench = Bench(settings, process.pid, browser)
        runs = [bench.run(pages, seconds) for pages in (0, 1, PAGES)]
        without, one, several = runs
        watched = bench.run(1, watched_s) if watched_s else one
    return {
        "runs": [vars(run) for run in (*runs, watched)],
        "seconds": seconds,
        "watched_s": watched_s,
        "updates_hz": one.updates_hz,
        "page_core_percent": 100.0
        * max((run.web_core - without.web_core) / run.pages for run in (one, several)),
        "age_effect_ms": several.age_p99_ms - without.age_p99_ms,
        "growth_mb": watched.growth_mb,
        "first_s": watched.first_s,
        "load": os.getloadavg()[0],
        "cores": len(cores),
    }


def show(figures: dict[str, Any]) -> None:
    """What is wanted beside what was measured."""
    for name, relation, value, words in TARGETS:
        met = COMPARED[relation](figures[name], value)
        print(f"  {'met   ' if met else 'MISSED'} {relation} {value:g} {words}: {figures[name]:.2f}")
    print(f"load of the machine during the last minute: {figures['load']:.1f} on {figures['cores']} cores")


@contextmanager
def _on(cores: set[int]) -> Iterator[None]:
    """Processes that are started meanwhile stay on these cores."""
    usual = os.sched_getaffinity(0)
    os.sched_setaffinity(0, cores)
    try:
        yield
    finally:
        os.sched_setaffinity(0, usual)


@contextmanager
def _driver(load: Load) -> Iterator[Any]:
    """A pipe to the process that stands for the gloves, which is ready."""
    spawn = multiprocessing.get_context("spawn")
    here, there = spawn.Pipe()
    process = spawn.Process(target=drive, args=(there, load))
    process.start()
    there.close()  # or nobody would hear that it died
    try:
        here.recv()
        yield here
    finally:
        here.close()
        process.join(10)
        if process.is_alive():
            process.terminate()
            process.join()


@contextmanager
def _said_to_stream(settings: Settings) -> Iterator[None]:
    """What a capture daemon says once a second of each glove."""
    status = json.dumps({"state": "streaming", "sentence": "", "rate_hz": RATE_HZ})
    ended = threading.Event()
    with open_client([settings.zenoh], wait_s=60) as session:

        def say() -> None:
            while not ended.wait(1.0):
                for number in range(GLOVES):
                    session.put(GloveKeys(settings.site, f"glove{number}").status, status)

        thread = threading.Thread(target=say)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()


def _store_models(settings: Settings) -> None:
    with Store.open(settings) as store:
        for number in range(PEOPLE):
            subject = f"person{number}"
            store.subjects.create(subject)
            model = random_model(subject, 100, seed=number)
            record = store.models.add(
                dump(model), subject=subject, layout=model.layout.name, method="spgp", parent=None, facts={}
            )
            store.models.activate(record.id)


def _heap_mb(page: Page) -> float:
    tools = page.context.new_cdp_session(page)
    tools.send("HeapProfiler.collectGarbage")
    used = tools.send("Runtime.getHeapUsage")["usedSize"]
    tools.detach()
    return used / 1e6


def _cpu_s(process: int) -> float:
    """Of all its threads, from /proc (Linux)."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main()
