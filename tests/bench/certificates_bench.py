"""What a site's certificates and rules cost live poses: beside a service without, in one run.

    python tests/bench/certificates_bench.py [--quick] [--smoke] [--json FILE]

Two real-time processes, one with TLS on both sides and the rules of a capture and a viewer, one as on a
computer alone; each with its gloves and its readers of poses (``streaming_load.py``). Windows of seconds
alternate between them, the order turned round each time, so that what else the computer does meets both.
Told are ratios: of a window's median and 99th percentile of latency, and of the real-time process's CPU time
a frame, whose inverse is how many frames a second it could predict. Lowest, median and highest over pairs
of windows.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from streaming_bench import PEOPLE, Case, free_port, helper, service, store_models
from streaming_load import Load, ProcessCost, drive

from glovecal_models.worker_processes import pin_blas_to_one_thread
from glovecal_service.settings import Settings
from glovecal_service.store.site.site_folder import SiteFolder

FIGURES = {"p50_ms": "median latency", "p99_ms": "99th percentile of latency", "cpu_us": "CPU time a frame"}


@dataclass(frozen=True)
class Side:
    """A service and what loads it."""

    driver: Any
    process: int

    def window(self, seconds: float) -> dict[str, float]:
        with ProcessCost(self.process) as cost:
            self.driver.send("start")
            self.driver.recv()
        self.driver.send("enough")
        latency_ms, _ = self.driver.recv()
        p50, p99 = np.percentile(latency_ms, [50, 99])
        spent_us = 1e6 * sum(cost.cpu_s.values())
        return {"p50_ms": p50, "p99_ms": p99, "cpu_us": spent_us / len(latency_ms), "poses": len(latency_ms)}


def side(folder: Path, case: Case, running: ExitStack, *, certificates: bool) -> Side:
    port = free_port()
    settings, members = Settings(data=folder, zenoh=f"tcp/127.0.0.1:{port}", site_file=None), None
    if certificates:
        site = SiteFolder(folder)
        site.begin("lab", [], zenoh_port=port, rest_port=free_port())
        settings = Settings(data=folder, zenoh=f"tls/127.0.0.1:{port}", site_file=site.service_file)
        members = (_file(site, folder, "capture"), _file(site, folder, "viewer"))
        os.environ["GLOVECAL_SITE_FILE"] = str(site.service_file)
    store_models(settings, case)
    process = running.enter_context(service(settings))
    os.environ.pop("GLOVECAL_SITE_FILE", None)
    load = Load(settings.zenoh, settings.site, case.gloves, PEOPLE, case.rate_hz, case.seconds, members)
    driver, _ = running.enter_context(helper(drive, load))
    driver.recv()
    return Side(driver, process)


def _file(site: SiteFolder, folder: Path, kind: Any) -> str:
    place = folder / f"{kind}.glovecal"
    place.write_text(site.add(kind, kind).document(), encoding="utf-8")
    place.chmod(0o600)
    return str(place)


def compared(case: Case, pairs: int) -> dict[str, Any]:
    """Figures of each pair of windows: without, and with certificates."""
    with tempfile.TemporaryDirectory(prefix="glovecal-bench-") as folder, ExitStack() as running:
        sides = [
            side(Path(folder) / name, case, running, certificates=name == "with")
            for name in ("without", "with")
        ]
        rows = []
        for number in range(pairs):
            order = (0, 1) if number % 2 == 0 else (1, 0)
            found = {which: sides[which].window(case.seconds) for which in order}
            rows.append((found[0], found[1]))
    return {"case": case.name, "seconds": case.seconds, "pairs": rows}


def told(result: dict[str, Any]) -> str:
    lines = [f"{result['case']}, {len(result['pairs'])} pairs of windows of {result['seconds']:g} s"]
    for name, what in FIGURES.items():
        ratios = np.array([tls[name] / plain[name] for plain, tls in result["pairs"]])
        usual = np.median([plain[name] for plain, _ in result["pairs"]])
        low, middle, high = np.percentile(ratios, [0, 50, 100])
        unit = "us" if name.endswith("us") else "ms"
        lines.append(
            f"  {what}: x {middle:.2f} ({low:.2f} to {high:.2f}); without certificates {usual:.3g} {unit}"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="fewer windows")
    parser.add_argument(
        "--smoke", action="store_true", help="only whether it runs: no figure is worth reading"
    )
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    pin_blas_to_one_thread()
    pairs, seconds = (1, 1.0) if options.smoke else (6, 4.0) if options.quick else (20, 5.0)
    results = []
    for gloves in (2,) if options.smoke else (2, 16):
        case = Case(f"{gloves} gloves at 120 Hz", gloves, 120.0, seconds, effects=True)
        results.append(compared(case, pairs))
        print(told(results[-1]), flush=True)
    print(f"load of the machine during the last minute: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    if options.json:
        options.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
