"""Lists, ``/ready`` and pages over a store as a site has it after years, and the memory of the web process.

    python tests/bench/lists_bench.py [--quick] [--smoke] [--store FOLDER] [--json FILE]

The service is asked over HTTP by another process: each list as it comes, its second and a late part, those of
one person, and those that hold a word; the median of five. Its pages are opened in Chromium, where that is
installed. What is kept in the store: ``large_store.py``.
"""

from __future__ import annotations

import argparse
import json
import re
import statistics
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
from realtime_support import free_endpoint, part_of_service

from glovecal_models.worker_processes import pin_blas_to_one_thread
from glovecal_service.serve import real_time, web
from glovecal_service.settings import Settings

TIMES = 5
LATE = 20
"""The part of a list that is asked for as a late one."""
SLOW_S = 2.0
"""What takes longer is asked once."""
PATIENCE_S = 900.0
LIST_MS, READY_MS, PAGE_S, WEB_MB = 200.0, 50.0, 2.0, 300.0
PAGES = ("models", "takes", "jobs", "start")
ASKED = {
    "of one person": {"subject": "p000042"},
    "with a word": {"text": "walk"},
    "with a word that is nowhere": {"text": "nowhere"},
}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="a tenth of the rows")
    parser.add_argument("--smoke", action="store_true", help="a hundredth: no figure is worth reading")
    parser.add_argument("--store", type=Path, help="keep the store in this folder; one that is there is used")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    from large_store import Size, fill  # not at the top: the service's processes import this module too

    pin_blas_to_one_thread()
    size = Size().divided(100 if options.smoke else 10 if options.quick else 1)
    with tempfile.TemporaryDirectory(prefix="glovecal-bench-") as folder:
        port = int(free_endpoint().rpartition(":")[2])
        data = options.store or Path(folder, "data")
        settings = Settings(data=data, zenoh=free_endpoint(), port=port, keep_days=10_000.0)
        if not data.exists():
            began = time.monotonic()
            fill(settings, size)
            print(f"{size}: made in {time.monotonic() - began:.0f} s", flush=True)
        figures = measure(settings)
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1))


def measure(settings: Settings) -> dict[str, Any]:
    """Milliseconds by what was asked, seconds by page, MB."""
    from glovecal_service.rest.app import create_app

    addresses = create_app(settings).openapi()  # its own document takes the service 24 MB
    url = f"http://127.0.0.1:{settings.port}"
    with (
        part_of_service(real_time, settings),
        part_of_service(web, settings) as process,
        httpx.Client(base_url=f"{url}/v1", timeout=PATIENCE_S, trust_env=False) as http,
    ):
        assert process.pid is not None
        print(f"web process when it has started: {_memory_mb(process.pid, 'VmRSS'):.0f} MB", flush=True)
        lists = dict(_lists(http, addresses))
        ready_ms = _median_ms(http, "/health/ready", {})
        _tell("/health/ready", ready_ms, READY_MS)
        overview_ms = _median_ms(http, "/overview", {})
        _tell("/overview", overview_ms, LIST_MS)
        print(f"web process after lists: {_memory_mb(process.pid, 'VmRSS'):.0f} MB", flush=True)
        pages = dict(_pages(url))
        memory_mb = {name: _memory_mb(process.pid, name) for name in ("VmRSS", "VmHWM")}
    print(f"{_verdict(memory_mb['VmHWM'], WEB_MB)} web process: {memory_mb['VmRSS']:.0f} MB, ", end="")
    print(f"at most {memory_mb['VmHWM']:.0f} MB")
    return {"lists_ms": lists, "ready_ms": ready_ms, "pages_s": pages, "memory_mb": memory_mb}


def _lists(http: httpx.Client, document: dict[str, Any]) -> Iterator[tuple[str, float]]:
    for path, operations in sorted(document["paths"].items()):
        listed = operations.get("get")
        if listed is None or "{" in path or not _is_list(document, listed):
            continue
        path = path.removeprefix("/v1")
        known = {each["name"] for each in listed.get("parameters", ())}
        asked = {"": {}} | {words: query for words, query in ASKED.items() if set(query) <= known}
        for words, query in asked.items():
            yield _listed(http, f"{path} {words}".strip(), path, query)
        late, query = http.get(path), {}
        for _ in range(LATE):
            if "next" not in late.links or late.elapsed.total_seconds() > SLOW_S:
                break
            query = dict(httpx.URL(late.links["next"]["url"]).params)
            late = http.get(path, params=query)
        else:
            yield _listed(http, f"{path} part {LATE + 1}", path, query)


def _listed(http: httpx.Client, words: str, path: str, query: dict[str, str]) -> tuple[str, float]:
    ms = _median_ms(http, path, query)
    _tell(words, ms, LIST_MS)
    return words, ms


def _is_list(document: dict[str, Any], operation: dict[str, Any]) -> bool:
    content = operation["responses"].get("200", {}).get("content", {}).get("application/json", {})
    return content.get("schema", {}).get("type") == "array"


def _median_ms(http: httpx.Client, path: str, query: dict[str, str]) -> float:
    taken = []
    for _ in range(TIMES):
        began = time.perf_counter()
        answer = http.get(path, params=query)
        taken.append(1e3 * (time.perf_counter() - began))
        if answer.status_code >= 400:
            print(f"  {path}: {answer.status_code} {answer.text[:200]}")
            break
        if taken[-1] > 1e3 * SLOW_S:
            break
    return statistics.median(taken)


def _pages(url: str) -> Iterator[tuple[str, float]]:
    from studio_support import NO_CHROMIUM, installed_chromium, running_browser

    if installed_chromium() is None:
        print(f"{NO_CHROMIUM}: pages were not measured.")
        return

    with running_browser() as browser:
        for name in PAGES:
            taken = []
            for _ in range(3):
                page = browser.new_page(viewport={"width": 1280, "height": 800})
                began = time.monotonic()
                try:
                    page.goto(f"{url}/studio/{name}", timeout=120_000)
                    page.get_by_role("heading", level=1).wait_for(timeout=120_000)
                    taken.append(time.monotonic() - began)
                except Exception as error:
                    print(f"  page {name}: {type(error).__name__} after {time.monotonic() - began:.0f} s")
                    taken.append(float("inf"))
                    break
                finally:
                    page.close()
            seconds = statistics.median(taken)
            print(f"{_verdict(seconds, PAGE_S)} page {name}: {seconds:.2f} s", flush=True)
            yield name, seconds


def _memory_mb(process: int, name: str) -> float:
    status = Path(f"/proc/{process}/status").read_text()
    found = re.search(rf"{name}:\s+(\d+) kB", status)
    assert found is not None
    return int(found[1]) / 1e3


def _tell(words: str, ms: float, most_ms: float) -> None:
    print(f"{_verdict(ms, most_ms)} {words}: {ms:.1f} ms", flush=True)


def _verdict(value: float, most: float) -> str:
    return "met   " if value <= most else "MISSED"


if __name__ == "__main__":
    main()
