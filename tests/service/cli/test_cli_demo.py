"""``glovecal demo`` as a process: its figures, its JSON, and nothing left behind, however it ends."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import time
from pathlib import Path

import pytest
from cli_running import COMMAND, environment
from realtime_support import eventually

linux = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks into /proc")


def start(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    """In an empty working directory, with a temporary folder of its own, leading a session."""
    work, temporary = folder / "work", folder / "temporary"
    work.mkdir()
    temporary.mkdir()
    return subprocess.Popen(
        [*COMMAND, "demo", *arguments],
        cwd=work,
        env=environment({}) | {"TMPDIR": str(temporary)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def session(leader: int) -> dict[int, list[str]]:
    """Processes alive in a session, with their command lines."""
    found = {}
    for entry in Path("/proc").iterdir():
        try:
            if not entry.name.isdecimal() or os.getsid(int(entry.name)) != leader:
                continue
            if (entry / "stat").read_text().rpartition(")")[2].split()[0] != "Z":
                found[int(entry.name)] = (entry / "cmdline").read_text().split("\0")
        except OSError:
            continue
    return found


def ports_listening(leader: int) -> set[int]:
    """TCP ports that processes of the session listen on."""
    inodes = set()
    for pid in session(leader):
        for entry in _entries(Path(f"/proc/{pid}/fd")):
            try:
                inodes |= set(re.findall(r"socket:\[(\d+)\]", os.readlink(entry)))
            except OSError:
                continue
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return {int(row[1].partition(":")[2], 16) for row in rows if row[3] == "0A" and row[9] in inodes}


def ports_while_streaming(process: subprocess.Popen[str]) -> set[int]:
    """The ports of the demo's service, once its first capture runs."""
    eventually(lambda: any("capture" in command for command in session(process.pid).values()), "it captures")
    return ports_listening(process.pid)


def _entries(folder: Path) -> list[Path]:
    try:
        return list(folder.iterdir())
    except OSError:
        return []


def all_listening() -> set[int]:
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return {int(row[1].partition(":")[2], 16) for row in rows if row[3] == "0A"}


def check_nothing_is_left(process: subprocess.Popen[str], folder: Path, ports: set[int]) -> None:
    eventually(lambda: not session(process.pid), "no process of the demo is left")
    assert not ports & all_listening()
    assert list((folder / "work").iterdir()) == []
    assert [item.name for item in (folder / "temporary").iterdir() if item.name.startswith("glovecal")] == []


@linux
@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_the_demo_keeps_its_promises(tmp_path):
    process = start(tmp_path, "--json", "--seed", "2", "--effect", "hysteresis")
    try:
        ports = ports_while_streaming(process)
        said, complaints = process.communicate(timeout=1100)
    finally:
        process.kill()
    assert process.returncode == 0, complaints
    assert "Traceback" not in complaints
    figures = json.loads(said.splitlines()[-1])
    second_act = {"hidden", "error_fall_deg", "noise_floor_deg"}
    assert set(figures) == {"rmse_deg", "latency_ms", "frames"} | second_act
    error = figures["rmse_deg"]
    assert set(error) == {"raw", "linear", "lmc_gpr", "spgp"}
    assert error["raw"] > error["linear"]
    assert error["lmc_gpr"] <= error["linear"] / 2
    assert error["spgp"] <= 1.1 * error["lmc_gpr"]
    assert set(figures["latency_ms"]) == {"p50", "p99"}
    assert 0 < figures["latency_ms"]["p50"] <= figures["latency_ms"]["p99"]
    frames = figures["frames"]
    assert set(frames) == {"sent", "received", "skipped"}
    # A put may be dropped where both cores are busy; the demo tells how many were.
    told = frames["received"] + frames["skipped"]
    assert 0.9 * frames["sent"] <= told <= frames["sent"] > 1000, said + complaints
    assert len(ports) >= 2
    assert "simulated" in said
    hidden, fall = figures["hidden"], figures["error_fall_deg"]
    assert (hidden["truth"], hidden["named"], hidden["right"], hidden["seed"]) == (
        "hysteresis",
        "hysteresis",
        True,
        2,
    )
    assert fall["with_effect"] < 0.6 * fall["lmc_gpr"]
    assert re.search(r"poses from it, [01]\.\d+ degrees from what the hand really did", said), said
    check_nothing_is_left(process, tmp_path, ports)


@linux
def test_a_demo_that_is_ended_leaves_nothing(tmp_path):
    """Only its first process is told. Ctrl-C on a terminal reaches all: test_cli_demo_stay.py."""
    process = start(tmp_path)
    try:
        ports = ports_while_streaming(process)
        time.sleep(0.5)
        os.kill(process.pid, signal.SIGTERM)
        _, complaints = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 143
    assert "Traceback" not in complaints
    assert len(ports) >= 2
    check_nothing_is_left(process, tmp_path, ports)
