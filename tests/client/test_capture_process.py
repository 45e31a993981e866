"""``glovecal-capture`` as a process of its own: killed, stopped, out of disk, without its router."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import zenoh
from loopback import eventually, free_endpoint, heard_of

from glovecal_client import Frame, FrameLog, Recording, decode_frame, encode_frame, fetch_frames, open_router
from glovecal_client.capture.command import main


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A recording of two sensors at 200 Hz to be replayed."""
    log = FrameLog.create(tmp_path / "source.glvlog", {"layout": "two", "sensors": ["A", "B"]})
    for i in range(400):
        log.append(encode_frame(Frame(i, 1, i * 5_000_000, 0, np.array([i, -i], np.float32))))
    log.close()
    return log.path


@contextmanager
def capture_process(recording: Path, endpoint: str, data: Path) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "glovecal_client.capture.command", "--device", f"replay:{recording}"]
    command += ["--option", "loop=yes", "--glove", "g1", "--connect", endpoint, "--data", str(data)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


class Heard:
    """Frames and statuses of glove g1."""

    def __init__(self, session: zenoh.Session) -> None:
        self.frames: list[Frame] = []
        self.statuses: list[dict] = []
        session.declare_subscriber(
            "glovecal/lab/g1/raw", lambda s: self.frames.append(decode_frame(s.payload.to_bytes()))
        )
        session.declare_subscriber(
            "glovecal/lab/g1/status", lambda s: self.statuses.append(json.loads(s.payload.to_bytes()))
        )


def logs(data: Path) -> list[Path]:
    return sorted(
        (data / "capture" / "lab" / "g1").glob("*.glvlog"), key=lambda path: path.stat().st_mtime_ns
    )


def sequences(path: Path) -> list[int]:
    return [frame.sequence for frame in Recording.open(path).frames()]


def test_its_image_is_healthy_while_it_is_at_work(recording: Path, tmp_path: Path) -> None:
    """Its service is away: it is at work all the same."""
    data = tmp_path / "data"

    def health() -> tuple[int, str]:
        command = [sys.executable, "-P", "-m", "glovecal_client.capture.health_check", str(data)]
        asked = subprocess.run(command, capture_output=True, text=True, check=False)
        return asked.returncode, asked.stdout

    assert health() == (1, f"No capture has its log in {data}.\n")
    with capture_process(recording, free_endpoint(), data) as process:
        eventually(lambda: health()[0] == 0, "healthy")
        assert health()[1].startswith("The capture of glove g1 was seen ")
        process.send_signal(signal.SIGSTOP)
        eventually(lambda: health()[0] == 1, "it stands still")
        process.send_signal(signal.SIGCONT)
        eventually(lambda: health()[0] == 0, "it goes on")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_stopped_by_a_signal_it_states_what_it_recorded(
    recording: Path, tmp_path: Path, number: signal.Signals
) -> None:
    endpoint = free_endpoint()
    with (
        open_router([endpoint]) as router,
        capture_process(recording, endpoint, tmp_path / "data") as process,
    ):
        heard = Heard(router)
        eventually(lambda: len(heard.frames) > 20, "frames")
        process.send_signal(number)
        output, _ = process.communicate(timeout=120)
        assert process.returncode == 0
        final = eventually(
            lambda: next((s for s in heard.statuses if s["state"] == "stopped"), None), "the final status"
        )
    (log,) = logs(tmp_path / "data")
    assert sequences(log) == list(range(final["frames"]))
    assert final["sequence"] == final["frames"] - 1
    assert f"{final['frames']} frames, 0 readings refused" in output


def test_killed_daemon_loses_nothing_published_and_its_run_can_be_fetched_after_the_restart(
    recording: Path, tmp_path: Path
) -> None:
    endpoint, data = free_endpoint(), tmp_path / "data"
    with open_router([endpoint]) as router:
        heard = Heard(router)
        with capture_process(recording, endpoint, data) as process:
            eventually(lambda: len(heard.frames) > 50, "frames")
            process.kill()
            process.wait()
        killed = list(heard.frames)
        (log,) = logs(data)
        on_disk = Recording.open(log).frames()
        assert [frame.sequence for frame in heard_of(list(on_disk), killed)] == [f.sequence for f in killed]
        with log.open("ab") as torn:
            torn.write(b"\x70\x00\x00\x00half a rec")
        with capture_process(recording, endpoint, data) as process:
            eventually(lambda: heard.frames[-1].run_id != killed[0].run_id, "a new run")
            again = fetch_frames(router, "lab", "g1", killed[0].run_id, 0, killed[-1].sequence)
            process.terminate()
            _, sentences = process.communicate(timeout=120)
    assert [frame.sequence for frame in again] == list(range(killed[-1].sequence + 1))
    assert "14 damaged bytes" in sentences
    assert [sequences(log)[0] for log in logs(data)] == [0, 0]


def test_full_disk_is_told_and_publishing_goes_on_and_the_recording_catches_up(
    recording: Path, tmp_path: Path
) -> None:
    endpoint, data = free_endpoint(), tmp_path / "data"
    no_limit = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
    with open_router([endpoint]) as router, capture_process(recording, endpoint, data) as process:
        heard = Heard(router)
        eventually(lambda: len(heard.frames) > 5, "frames")
        (log,) = logs(data)
        full = log.stat().st_size + 1000
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (full, no_limit[1]))
        told = eventually(lambda: next((s for s in heard.statuses if s["disk"] == "full"), None), "disk full")
        assert "the recording does not reach the disk" in told["sentence"]
        before = len(heard.frames)
        eventually(lambda: len(heard.frames) > before + 50, "frames go on")
        eventually(lambda: heard.statuses[-1]["frames_not_logged"] > 0, "they are counted as not logged")
        assert log.stat().st_size <= full
        assert sequences(log) == list(range(len(sequences(log))))
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, no_limit)
        eventually(lambda: heard.statuses[-1]["disk"] == "ok", "disk is fine again")
        process.terminate()
        output, _ = process.communicate(timeout=120)
    assert "0 frames not in the log" in output
    assert f"{len(sequences(log))} frames, " in output
    assert sequences(log) == list(range(len(sequences(log))))


def test_frozen_router_does_not_hold_up_the_recording(recording: Path, tmp_path: Path) -> None:
    endpoint, data = free_endpoint(), tmp_path / "data"
    script = (
        "import sys, time; from glovecal_client import open_router\n"
        "with open_router([sys.argv[1]]): print('up', flush=True); time.sleep(60)\n"
    )
    router = subprocess.Popen([sys.executable, "-c", script, endpoint], stdout=subprocess.PIPE, text=True)
    try:
        assert router.stdout is not None
        assert router.stdout.readline() == "up\n"
        with capture_process(recording, endpoint, data) as process:
            (log,) = eventually(lambda: logs(data), "a recording")
            eventually(lambda: len(sequences(log)) > 20, "frames")
            os.kill(router.pid, signal.SIGSTOP)
            size = len(sequences(log))
            eventually(lambda: len(sequences(log)) > size + 400, "two more seconds of frames")
            process.terminate()
            process.communicate(timeout=120)
        assert sequences(log) == list(range(len(sequences(log))))
    finally:
        router.kill()
        router.communicate()


def test_glove_of_a_frozen_capture_is_free_as_soon_as_that_is_dead(recording: Path, tmp_path: Path) -> None:
    endpoint = free_endpoint()
    with open_router([endpoint]) as router:
        heard = Heard(router)
        with capture_process(recording, endpoint, tmp_path / "a") as frozen:
            eventually(lambda: heard.frames, "frames of the first")
            frozen.send_signal(signal.SIGSTOP)
            with capture_process(recording, endpoint, tmp_path / "b") as second:
                eventually(lambda: logs(tmp_path / "b"), "the second has started")
                assert {frame.run_id for frame in heard.frames} == {heard.frames[0].run_id}
                frozen.kill()
                eventually(lambda: heard.frames[-1].run_id != heard.frames[0].run_id, "it publishes")
                second.terminate()
                second.communicate(timeout=120)
                assert second.returncode == 0


def test_closed_terminal_does_not_end_the_recording(recording: Path, tmp_path: Path) -> None:
    with capture_process(recording, free_endpoint(), tmp_path / "data") as process:
        assert process.stderr is not None
        process.stderr.readline()
        process.stderr.close()
        process.stderr = None
        (log,) = eventually(lambda: logs(tmp_path / "data"), "a recording")
        eventually(lambda: len(sequences(log)) > 300, "frames")
        process.terminate()
        output, _ = process.communicate(timeout=120)
    assert process.returncode == 0
    assert " 0 readings refused" in output


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--device", "replai:x", "--glove", "g1"], "did you mean 'replay'"),
        (["--device", "replay:/nowhere.csv", "--glove", "g1"], "nowhere.csv"),
        (["--device", "replay:{r}", "--glove", "../g1"], "glove: '../g1' is not allowed"),
        (["--device", "replay:{r}", "--glove", "g1", "--site", "a b"], "site: 'a b' is not allowed"),
        (["--device", "replay:{r}", "--glove", "g1", "--subject", ".."], "subject: '..' is not allowed"),
        (["--device", "replay:{r}", "--glove", "g1", "--wearing", "1\0"], "wearing:"),
        (["--device", "replay:{r}", "--glove", "g1", "--option", "speed"], "'speed' is not KEY=VALUE"),
        (["--device", "replay:{r}", "--glove", "g1", "--option", "a=1", "--option", "a=2"], "twice"),
        (["--device", "replay:{r}", "--glove", "g1", "--connect", "localhost"], "endpoint 'localhost'"),
        (["--device", "replay:{r}", "--glove", "g1", "--data", "/dev/null"], "cannot write in /dev/null"),
    ],
)
def test_what_cannot_be_captured_is_refused_with_a_sentence(
    recording: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    sentence: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([argument.replace("{r}", str(recording)) for argument in arguments]) == 1
    assert sentence in capsys.readouterr().err
