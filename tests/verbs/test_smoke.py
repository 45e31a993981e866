"""Verbs of ``do.py`` with ``--smoke``: their work in small, with what is installed and no network.

Two verbs at a time: most of them wait for a process to start. ``docs`` is tried where its site is read.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import pytest

ROOT = Path(__file__).resolve().parents[2]
OF_A_USER = {
    "GLOVECAL_DATA": "/nowhere",
    "GLOVECAL_URL": "http://127.0.0.1:9",
    "PYTHONPATH": str(Path(__file__).parent / "of_a_user"),
    "PYTHONUNBUFFERED": "1",
    "PYTHONWARNINGS": "ignore",
    "LC_ALL": "C",
    "TZ": "UTC",
    "MPLBACKEND": "nonsense",
    "ANYTHING_ELSE": "1",
    "OMP_NUM_THREADS": "7",
}
"""Settings that would change what tests do, and a folder with another numpy in it."""
NO_NETWORK = {"UV_OFFLINE": "1", "PIP_NO_INDEX": "1", "HTTPS_PROXY": "http://127.0.0.1:9"}
VERBS = (
    "demo",
    "serve",
    "glovecal",
    "test",
    "check",
    "paper",
    "study",
    "study active",
    "study offline",
    "study planted",
    "study camera-errors --help",
    "study camera-applications",
    "fresh",
    "containers",
    "sbom",
)


@dataclass(frozen=True)
class Said:
    """How a verb ended, and all it said."""

    code: int
    text: str

    def number(self, pattern: str) -> float:
        """The figure in the first group of ``pattern``; the verb has to have ended well."""
        assert self.code == 0, self.text
        found = re.search(pattern, self.text)
        assert found, self.text
        return float(found[1])


@pytest.fixture(scope="module")
def smoke(not_here: Callable[[str], NoReturn]) -> Iterator[dict[str, Future[Said]]]:
    """All verbs, begun at once; nothing may be installed on the way."""
    if not (ROOT / ".venv").is_dir() or not (ROOT / ".tools" / "uv").is_dir():
        not_here("there is no .venv (python3 do.py test makes it)")
    before = _installed()
    with ThreadPoolExecutor(2) as pool:
        yield {verb: pool.submit(_run, verb, OF_A_USER if verb == "test" else {}) for verb in VERBS}
    assert _installed() == before


def _run(verb: str, settings: dict[str, str]) -> Said:
    command = [sys.executable, str(ROOT / "do.py"), *verb.split(), "--smoke"]
    if "GLOVECAL_DATA" in settings:  # as a script begins what it does not wait for
        command = ["sh", "-c", 'trap "" INT HUP; umask 077; exec "$@"', "sh", *command]
    mine = {name: value for name, value in os.environ.items() if not name.startswith("GLOVECAL_")}
    done = subprocess.run(
        command,
        env=mine | NO_NETWORK | settings,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=500,
    )
    return Said(done.returncode, done.stdout)


def _installed() -> set[str]:
    return {entry.name for folder in (ROOT / ".tools", *_packages()) for entry in folder.iterdir()}


def _packages() -> list[Path]:
    return sorted((ROOT / ".venv").glob("lib/python*/site-packages"))


def test_demo_calibrates_and_serves_a_glove(smoke) -> None:
    said = smoke["demo"].result()
    assert said.number(r"([\d.]+) linear") < 0.7 * said.number(r"error ([\d.]+) degrees raw")
    sent = said.number(r"(\d+) frames sent live")
    assert 0.9 * sent <= said.number(r"(\d+) poses received") <= sent
    assert sent > 100


def test_serve_gets_ready_on_free_ports_and_stops(smoke) -> None:
    said = smoke["serve"].result()
    assert said.number(r"ready on http://127\.0\.0\.1:(\d+)") != said.number(r"tcp/127\.0\.0\.1:(\d+)")
    assert "stopped" in said.text


def test_the_command_line_lists_its_effects(smoke) -> None:
    said = smoke["glovecal"].result()
    assert said.code == 0, said.text
    assert "hysteresis" in said.text


def test_tests_run_and_pass_whatever_their_user_has_set(smoke) -> None:
    assert smoke["test"].result().number(r"(\d+) passed") > 10


def test_check_formats_lints_and_types(smoke) -> None:
    said = smoke["check"].result()
    assert said.number(r"(\d+) errors?, ") == 0
    assert "already formatted" in said.text
    assert "All checks passed" in said.text


@pytest.mark.slow
def test_bench_prints_its_tables() -> None:
    said = _run("bench", {})
    assert said.number(r"Glovecal, all rotations: ([\d.]+) s on one core") > 0
    assert said.number(r"thumb and index: Glovecal (\d+)") > 100
    assert "== streaming ==" in said.text


def test_paper_writes_a_page(smoke) -> None:
    said = smoke["paper"].result()
    assert said.code == 0, said.text
    assert "table-1: took" in said.text
    assert "paper-quick.html" in said.text


def test_study_names_the_effect_of_one_glove(smoke) -> None:
    assert smoke["study"].result().number(r"right effect first[^|]*, lag \| ([\d.]+) %") == 100


def test_study_of_active_sampling_compares_two_ways(smoke) -> None:
    said = smoke["study active"].result()
    errors = [said.number(rf"\| {way} \| \d+ \| \d+ \| ([\d.]+) ") for way in ("any step", "active")]
    assert all(0 < error < 90 for error in errors)


def test_study_of_recordings_tells_what_a_delay_buys(smoke) -> None:
    said = smoke["study offline"].result()
    live, offline = (
        said.number(rf"noise alone \| 1 \|{skipped} ([\d.]+) ") for skipped in ("", r" [\d.]+ \|")
    )
    assert 0 < offline < live < 5
    # In the row of the curve live comes first, then 0, 50, 100 and 200 ms.
    curve = r"noise alone \|(?: [\d.]+ \|){3} ([\d.]+) (?:\| [\d.]+ ){2}\| [\d.]+ to [\d.]+ %"
    at_100_ms = said.number(curve)
    assert offline <= at_100_ms < live


def test_study_of_planted_faults_tells_nothing_of_a_healthy_glove(smoke) -> None:
    assert smoke["study planted"].result().number(r"simulated, healthy \|[ |]* (\d+) of 1 ") == 0


def test_study_of_the_cameras_errors_begins(smoke) -> None:
    """Its smallest work draws and tracks for a minute."""
    said = smoke["study camera-errors --help"].result()
    assert said.code == 0, said.text
    assert "--first-seed" in said.text


def test_study_of_the_examples_tells_what_errors_leave(smoke) -> None:
    said = smoke["study camera-applications"].result()
    assert said.number(r"\| 1 degrees, of 0\.5 s \| (\d+) % ") == 100
    assert said.number(r"\| 12 degrees, that stay (?:\| \d+ % ){2}\| (\d+) % ") < 100


def test_fresh_asks_a_new_clone(smoke, not_here: Callable[[str], NoReturn]) -> None:
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        not_here("needs git and a checkout that can be cloned")
    assert smoke["fresh"].result().number(r"\| ended with code (\d+), \d+ s \|") == 0


def test_sbom_lists_what_is_installed(smoke) -> None:
    assert smoke["sbom"].result().number(r"(\d+) packages: .*sbom\.cdx\.json") > 50


def test_container_files_are_looked_at(smoke) -> None:
    assert smoke["containers"].result().number(r"Container files: (\d+) problems") == 0


def test_smoke_refuses_where_nothing_is_installed(tmp_path: Path) -> None:
    copy = tmp_path / "do.py"
    copy.write_text((ROOT / "do.py").read_text())
    done = subprocess.run([sys.executable, str(copy), "serve", "--smoke"], capture_output=True, text=True)
    assert done.returncode == 2
    assert "--smoke installs nothing" in done.stderr
    assert not (tmp_path / ".tools").exists()
