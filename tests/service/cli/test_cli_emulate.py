"""``glovecal emulate``, captured with the command that it prints, and ``glovecal read-card``."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import threading
import time
from itertools import pairwise
from pathlib import Path

import pytest
from cli_running import COMMAND
from free_ports import free_endpoint
from realtime_support import eventually

from glovecal_client import Recording, open_router
from glovecal_client.capture.command import main as capture_alone
from glovecal_client.capture.command import parse_options, run_capture
from glovecal_client.capture.daemon import CaptureSettings
from glovecal_client.keys import GloveKeys
from glovecal_service.emulators.catalogue import PROTOCOLS
from glovecal_service.emulators.cyberglove3 import EmulatedCyberGlove3, card_file

POSIX_ONLY = pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are a POSIX thing")


@POSIX_ONLY
@pytest.mark.parametrize("name", PROTOCOLS)
def test_it_starts_says_how_to_capture_it_and_leaves_nothing(run, name: str, tmp_path: Path) -> None:
    port = tmp_path / f"emulated-{name}"
    answer = run("emulate", name, "--port", port, "--seconds", "0.2", "--fault", "noise")
    assert answer.code == 0
    assert "every reading is simulated" in answer.out
    assert re.search(rf"glovecal capture --device \S*:?.*{port} ?.*--glove right", answer.out)
    assert not port.is_symlink()


def test_what_cannot_be_emulated_is_refused(run, tmp_path: Path) -> None:
    assert "did you mean 'cyberglove'? There are cyberglove, cyberglove3" in run("emulate", "powerglove").said
    assert (
        "homunculus has no fault 'battery'; there are unplug"
        in run("emulate", "homunculus", "--fault", "battery").said
    )
    assert "homunculus is emulated with --port alone" in run("emulate", "homunculus", "--udp", "h:1").said
    assert "must be HOST:PORT" in run("emulate", "line", "--udp", "5000").said
    assert "give one of" in run("emulate", "line", "--udp", "h:1", "--tcp", "h:1").said
    taken = tmp_path / "taken"
    taken.touch()
    assert "exists already" in run("emulate", "line", "--port", taken, "--seconds", "0.1").said


@POSIX_ONLY
def stop_after(count: int, data: Path, stop: threading.Event) -> None:
    """Set ``stop`` once so many frames are in the log of the capture that writes to ``data``."""

    def frames(log: Path) -> int:
        return len(list(Recording.open(log).frames()))

    try:
        eventually(lambda: any(frames(log) > count for log in data.rglob("*.glvlog")), "frames")
    finally:
        stop.set()


def test_capture_records_an_emulated_glove_as_simulated(tmp_path: Path) -> None:
    """The command as a process of its own, and the line it prints."""
    process = subprocess.Popen([*COMMAND, "emulate", "lucidglove"], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        lines = [process.stdout.readline() for _ in range(2)]
        words = shlex.split(lines[1])
        device = words[words.index("--device") + 1]
        options = parse_options([word for before, word in pairwise(words) if before == "--option"])
        endpoint, stop = free_endpoint(), threading.Event()
        with open_router([endpoint]):
            threading.Thread(target=stop_after, args=(60, tmp_path, stop)).start()
            settings = CaptureSettings(GloveKeys("lab", "right"), endpoints=(endpoint,), data=tmp_path)
            summary = run_capture(device, settings, options, stop=stop)
    finally:
        process.terminate()
        process.communicate(timeout=120)
    recording = Recording.open(summary.log)
    frames = list(recording.frames())
    assert len(frames) > 50
    assert all(frame.simulated for frame in frames)
    assert (recording.meta["layout"], recording.meta["simulated"]) == ("lucidglove", True)
    assert summary.bad_frames == summary.reconnects == 0


def test_capture_alone_refuses_what_cannot_be_in_one_sentence(capsys, tmp_path: Path) -> None:
    begun = time.monotonic()
    arguments = [
        "--device",
        "line:nowhere.toml",
        "--option",
        "port=p",
        "--glove",
        "right",
        "--data",
        str(tmp_path),
    ]
    assert capture_alone(arguments) == 1
    assert "nowhere.toml cannot be read" in capsys.readouterr().err
    assert time.monotonic() - begun < 5


def test_a_card_becomes_a_take(run, tmp_path: Path) -> None:
    glove = EmulatedCyberGlove3()
    glove.feed(b"1m\x03", 0.0)
    card, table = tmp_path / "MONDAY", tmp_path / "monday.csv"
    card.write_bytes(card_file("monday", [glove.record(number / 90) for number in range(180)]))
    answer = run("read-card", card, table)
    assert "180 records over 2.0 s; 0 damaged, 0 bytes between records" in answer.out
    assert run("subject", "add", "anna").code == 0
    imported = run("take", "import", table, "--layout", "cyberglove3-22", "--subject", "anna", "--json")
    assert imported.json
    assert "exists already" in run("read-card", card, table).said
