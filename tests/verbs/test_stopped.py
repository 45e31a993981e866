"""A verb of ``do.py`` that is asked to stop leaves nothing of its own running."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

import psutil
import pytest

ROOT = Path(__file__).resolve().parents[2]
PATIENCE_S = 120.0


@contextmanager
def _demo(
    not_here: Callable[[str], NoReturn],
) -> Iterator[tuple[subprocess.Popen[bytes], list[psutil.Process]]]:
    """The small demo, and all processes below it once its service is one of them."""
    if not (ROOT / ".tools").is_dir() or not (ROOT / ".venv").is_dir():
        not_here("the verbs of do.py were never run in this folder: python3 do.py glovecal effects")
    command = [sys.executable, "do.py", "demo", "--smoke"]
    verb = subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    below: list[psutil.Process] = []
    try:
        until = time.monotonic() + PATIENCE_S
        while not any("serve" in _words(process) for process in below):
            assert verb.poll() is None
            assert time.monotonic() < until
            time.sleep(0.05)
            below = psutil.Process(verb.pid).children(recursive=True)
        yield verb, below
    finally:
        for process in (verb, *below):
            if process.is_running() if isinstance(process, psutil.Process) else process.poll() is None:
                process.kill()
        verb.wait()


def _words(process: psutil.Process) -> list[str]:
    try:
        return process.cmdline()
    except psutil.Error:
        return []


@pytest.mark.skipif(sys.platform == "win32", reason="a process is told to stop by a signal")
def test_a_demo_that_is_told_to_stop_stops_its_service(not_here: Callable[[str], NoReturn]) -> None:
    with _demo(not_here) as (verb, below):
        verb.send_signal(signal.SIGTERM)
        assert verb.wait(PATIENCE_S) != 0
        assert [process for process in below if "serve" in _words(process)] == []
