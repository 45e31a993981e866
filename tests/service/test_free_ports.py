"""Ports for tests: none is given twice, by whichever process of pytest, nor where the system finds them."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
from pathlib import Path

from free_ports import EACH, FIRST, PROCESSES, free_port

TESTS = Path(__file__).parents[1]
OUTSIDE_PYTEST = {"bench/streaming_bench.py", "blender/try_blender.py", "containers/containers.py"}


def given_to(worker: str, count: int) -> set[int]:
    code = f"from free_ports import free_port\nprint(*(free_port() for _ in range({count})))"
    place = os.environ | {"PYTEST_XDIST_WORKER": worker, "PYTHONPATH": str(TESTS / "simulated")}
    done = subprocess.run([sys.executable, "-c", code], env=place, capture_output=True, text=True, check=True)
    return set(map(int, done.stdout.split()))


def test_processes_of_one_run_never_get_the_same() -> None:
    first, second = given_to("gw0", 200), given_to("gw1", 200)
    assert len(first) == len(second) == 200
    assert not first & second


def test_none_is_one_that_the_system_gives() -> None:
    places = Path("/proc/sys/net/ipv4/ip_local_port_range")
    lowest = int(places.read_text().split()[0]) if places.exists() else 32768
    assert lowest >= FIRST + EACH * PROCESSES


def test_one_at_which_somebody_listens_is_left_out() -> None:
    port = free_port()
    with socket.create_server(("127.0.0.1", port)):
        assert port not in {free_port() for _ in range(EACH - 1)}


def test_no_test_has_ports_of_its_own_making() -> None:
    own = re.compile(r"def _?free_(port|endpoint)\b")
    found = {str(file.relative_to(TESTS)) for file in TESTS.rglob("*.py") if own.search(file.read_text())}
    assert found - OUTSIDE_PYTEST == {"simulated/free_ports.py"}
