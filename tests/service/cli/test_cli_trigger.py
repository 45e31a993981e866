"""``glovecal trigger`` with a real service and two gloves: takes as other systems ask for them, over UDP."""

from __future__ import annotations

import re
import socket
import struct
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import BinaryIO

import pytest
from cli_running import Run, Started, glovecal, start
from ltc_sound import endless_ltc, pcm
from realtime_support import eventually, free_endpoint
from trigger_packets import RECORD_START, RECORD_STOP, START, STOP, natnet

from glovecal_client.clock import clock_s
from glovecal_client.rest import RestClient
from glovecal_models.takes.time_code import TimeCode

HERE = "127.0.0.1"
HANDS = ("right", "left")


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """A service, and both hands of a simulated person captured from it."""
    folder, endpoint = tmp_path_factory.mktemp("trigger"), free_endpoint()
    port = free_endpoint().rpartition(":")[2]
    settings = {"GLOVECAL_DATA": str(folder / "data"), "GLOVECAL_ZENOH": endpoint, "GLOVECAL_PORT": port}
    settings |= {"GLOVECAL_STUDIO": "no"}
    with ExitStack() as running:
        process = start(settings, "serve")
        running.callback(end, process)
        assert process.stdout is not None
        assert process.stdout.readline().startswith("Glovecal is running")
        reach = {"GLOVECAL_URL": f"http://127.0.0.1:{port}", "GLOVECAL_ZENOH": endpoint}
        reach["GLOVECAL_DATA"] = str(folder / "capture")
        for seed, hand in enumerate(HANDS):
            options = ("--option", f"seed={seed}", "--option", f"hand={hand}", "--option", "rate_hz=60")
            capture = start(
                reach, "capture", "--device", "simulated", "--glove", hand, "--subject", "anna", *options
            )
            running.callback(end, capture)
        run = partial(glovecal, reach)
        eventually(lambda: len(run("glove", "list", "--json").json["seen"]) == 2, "both are seen")
        yield reach


def end(process: Started) -> tuple[str, str]:
    process.terminate()
    return process.communicate(timeout=60)


class Stage:
    """The other system: sends packets, and takes those that come back."""

    def __init__(self, port: int, live: dict[str, str], process: Started) -> None:
        self.process = process
        self.run: Run = partial(glovecal, live)
        self._port, self._url = port, live["GLOVECAL_URL"]
        self.complaints = ""
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind((HERE, 0))
        self.socket.settimeout(120)

    def send(self, *packets: bytes) -> None:
        for packet in packets:
            self.socket.sendto(packet, (HERE, self._port))

    def recordings(self, state: str | None = None) -> list[dict]:
        """Newest first."""
        rows = self.get("/recordings")
        return [row for row in rows if state in (None, row["state"])]

    def get(self, path: str):
        with RestClient(self._url) as client:
            return client.get(path)

    def recorded(self, name: str, count: int = 2) -> list[dict]:
        """Takes of that name, once all are stored."""

        def stored() -> list[dict] | None:
            takes = [take for take in self.get("/takes") if take["name"] == name]
            return takes if len(takes) == count else None

        return eventually(stored, f"{count} takes {name}")

    def goes_on(self, count: int) -> bool:
        return len(self.recordings("recording")) == count

    def receive(self) -> bytes:
        return self.socket.recv(4096)


@contextmanager
def triggered(live: dict[str, str], *options: str, protocol: str = "vicon") -> Iterator[Stage]:
    """``glovecal trigger right left``, until the block ends; it must end cleanly."""
    port = int(free_endpoint().rpartition(":")[2])
    listening = ("--listen", f"{protocol}:{port}", "--pre-roll", "1")
    process = start(live, "trigger", *HANDS, *listening, *options, stdin=subprocess.PIPE)
    try:
        assert process.stdout is not None
        while not (line := process.stdout.readline()).startswith("Gloves: right, left."):
            assert line, process.communicate()
        stage = Stage(port, live, process)
        with stage.socket:
            yield stage
    finally:
        out, complaints = end(process)
    stage.complaints = complaints
    assert "Traceback" not in complaints
    assert re.search(r"^\d+ triggers", out, re.MULTILINE), out


@contextmanager
def receiver() -> Iterator[tuple[socket.socket, str]]:
    """Another system that is told of recordings, and where."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind((HERE, 0))
        other.settimeout(120)
        yield other, f"{HERE}:{other.getsockname()[1]}"


def test_both_hands_are_recorded_as_vicon_asks(live: dict[str, str]) -> None:
    with receiver() as (other, send), triggered(live, "--rate", "25", "--send", f"vicon:{send}") as stage:
        before_s = time.time()
        stage.send(START, START, START)
        eventually(lambda: stage.goes_on(2), "both hands are recorded")
        stage.send(STOP.replace(b"Walk 01", b"Walk/01 good"), STOP)
        takes = stage.recorded("Walk_01 good")
        passed_on = other.recv(4096)
    assert re.search(rb'<TimeCode VALUE="10:2\d:\d\d:\d\d" />', passed_on), "the trigger's, counted on"
    assert {take["known_hand"] for take in takes} == set(HANDS)
    assert len(stage.recordings()) == 2
    for take in takes:
        told = take["facts"]["trigger"]
        assert (told["start"]["name"], told["stop"]["name"]) == ("Walk 01", "Walk/01 good")
        assert (told["start"]["notes"], told["stop"]["result"]) == ("slow & wide", "SUCCESS")
        assert told["start"]["clock"] == "monotonic", "the glove is captured on the same computer"
        wall_s = told["start"]["time_s"] + take["accounting"]["wall_minus_time_s"]
        assert abs(wall_s - 0.033 - told["start"]["wall_s"]) < 0.02
        assert 0 <= told["start"]["wall_s"] - before_s < 60
        first_s = take["accounting"]["begins_s"]
        assert told["start"]["time_s"] < first_s + 0.1
        assert told["stop"]["time_s"] > first_s
        code = take["time_code"]
        assert (code["label"], code["rate"], code["drop"]) == ("10:20:30:12", "25", False)
        assert code["time_s"] == told["start"]["time_s"]
        said = stage.run("take", "check", take["id"]).out
        assert re.search(
            r"time code +10:20:3\d:\d\d to 10:2\d:\d\d:\d\d, 25 frames a second, from trigger", said
        )


def test_a_name_that_is_taken_gets_a_number(live: dict[str, str]) -> None:
    with triggered(live) as stage:
        for number, name in enumerate(("Twice", "Twice-2")):
            ids = [str(900 + 2 * number + part).encode() for part in range(2)]
            stage.send(START.replace(b"Walk 01", b"Twice").replace(b"28472", ids[0]))
            eventually(lambda: stage.goes_on(2), "both hands are recorded")
            stage.send(STOP.replace(b"Walk 01", b"Twice").replace(b"28473", ids[1]))
            takes = stage.recorded(name)
            assert all(take["time_code"] is None for take in takes), "nobody said the frame rate"
            assert takes[0]["facts"]["trigger"]["start"]["time_code"] == "10:20:30:12"


class Line(threading.Thread):
    """What ``arecord`` would write: 25 frames a second from 10:00:00:00 on, until it is cut."""

    def __init__(self, process: Started) -> None:
        super().__init__(daemon=True)
        assert process.stdin is not None
        self._stream: BinaryIO = process.stdin.buffer  # type: ignore[attr-defined]
        self._cut = threading.Event()
        self.begin_s = clock_s()

    def run(self) -> None:
        form = struct.pack("<IHHIIHH", 16, 1, 1, 12_000, 24_000, 2, 16)
        with suppress(BrokenPipeError):
            self._stream.write(b"RIFF\xff\xff\xff\xffWAVEfmt " + form + b"data\xff\xff\xff\xff")
            sent = 0
            for second in endless_ltc(25 * 36_000, 12_000):
                for part in second.reshape(10, -1, 1):
                    sent += len(part)
                    if self._cut.wait(max(0.0, self.begin_s + sent / 12_000 - clock_s())):
                        return
                    self._stream.write(pcm(0.3 * part))
                    self._stream.flush()

    def cut(self) -> None:
        self._cut.set()
        self.join()


def test_takes_get_the_time_code_of_a_line_and_others_are_told_it(live: dict[str, str]) -> None:
    with receiver() as (other, send), triggered(live, "--ltc", "-", "--send", f"vicon:{send}") as stage:
        line = Line(stage.process)
        line.start()
        eventually(lambda: "Time code on the line: 10:00:" in stage.process.so_far, "it is heard")
        stage.send(START.replace(b"Walk 01", b"Coded").replace(b"28472", b"31"))
        eventually(lambda: stage.process.so_far.count("): time code 10:00:") == 2, "both have it")
        sent = other.recv(4096)
        line.cut()
        eventually(lambda: "No time code on the line since 10:0" in stage.process.so_far, "its loss")
        stage.send(STOP.replace(b"Walk 01", b"Coded").replace(b"28473", b"32"))
        takes = stage.recorded("Coded")
    assert re.search(rb'<TimeCode VALUE="10:0\d:\d\d:\d\d" />', sent)
    for take in takes:
        code = TimeCode(**take["time_code"])
        assert (code.rate, code.source) == ("25", "LTC of a line")
        label = code.at(line.begin_s + 1.02)
        assert label[:8] in ("10:00:01", "10:00:00"), "sound that a busy computer reads late"
        assert take["facts"]["trigger"]["start"]["time_code"] == "10:20:30:12", "kept as it was sent"


def test_natnet_and_its_answers(live: dict[str, str]) -> None:
    with triggered(live, protocol="natnet") as stage:
        stage.send(natnet("StopRecording"))
        assert stage.receive()[-4:] == b"\1\0\0\0", "nothing was going on"
        stage.send(natnet("SetRecordTakeName,Run"), natnet("StartRecording"))
        assert [stage.receive()[-4:] for _ in range(2)] == [b"\0\0\0\0"] * 2
        assert stage.goes_on(2), "it is answered once both are recorded"
        stage.send(natnet("StopRecording"))
        assert stage.receive()[-4:] == b"\0\0\0\0"
        stage.recorded("Run")


def test_osc_a_lost_stop_and_a_process_that_died(live: dict[str, str]) -> None:
    """The second start ends the first take; what a process began the next one ends."""
    with triggered(live, protocol="osc") as stage:
        stage.send(RECORD_START)
        assert stage.receive().startswith(b"/RecordStartConfirm")
        stage.send(RECORD_START)
        assert stage.receive().startswith(b"/RecordStartConfirm"), "it is recorded already"
        stage.send(RECORD_START.replace(b"\x04", b"\x05"))
        assert stage.receive().startswith(b"/RecordStartConfirm")
        stage.recorded("Scene_4")
        assert {row["name"] for row in stage.recordings("recording")} == {"Scene_5"}
    with triggered(live, protocol="osc") as stage:
        stage.send(RECORD_STOP)
        assert stage.receive().startswith(b"/RecordStopConfirm")
        stage.recorded("Scene_5")


def test_what_a_person_records_is_told_to_others_and_left_alone(live: dict[str, str]) -> None:
    with receiver() as (other, send):
        targets = [word for name in ("vicon", "natnet", "osc") for word in ("--send", f"{name}:{send}")]
        with triggered(live, *targets) as stage:
            recording = start(live, "record", "right", "By hand", "--seconds", "600", "--pre-roll", "0")
            try:
                started = [other.recv(4096) for _ in range(4)]
                stage.send(STOP.replace(b"28473", b"1"))
                assert started[0].startswith(b"<?xml")
                assert b'<CaptureStart><Name VALUE="By hand" />' in started[0]
                assert started[1:3] == [natnet("SetRecordTakeName,By hand"), natnet("StartRecording")]
                assert started[3] == b"/RecordStart\0\0\0\0,si\0By hand\0\0\0\0\1"
                stage.send(STOP.replace(b"28473", b"2"))
                assert stage.goes_on(1), "a person's recording goes on"
            finally:
                recording.send_signal(2)
                recording.communicate(timeout=120)
            stopped = [other.recv(4096) for _ in range(3)]
        assert b'<CaptureStop RESULT="SUCCESS"><Name VALUE="By hand" />' in stopped[0]
        assert stopped[1:] == [natnet("StopRecording"), RECORD_STOP]


def test_what_cannot_be_is_refused(live: dict[str, str]) -> None:
    run = partial(glovecal, live)
    assert "say what to listen for" in run("trigger", "right").said
    assert "did you mean 'vicon'" in run("trigger", "right", "--listen", "vicom").said
    assert "no frame rate '26'" in run("trigger", "right", "--listen", "vicon:1512", "--rate", "26").said
    beyond = run("trigger", "right", "--listen", "vicon:0.0.0.0:1512")
    assert "--from, an address or a network such as 192.168.1.0/24" in beyond.said
    assert "is no address or network" in run("trigger", "right", "--listen", "osc", "--from", "me").said
    assert "there is no host" in run("trigger", "right", "--send", "osc:no-such-host.invalid:8000").said


def test_a_service_that_is_away_is_told_and_waited_for(tmp_path: Path) -> None:
    """A start is given up after ten seconds; an end is carried out once the service is back."""
    port = free_endpoint().rpartition(":")[2]
    away = {"GLOVECAL_URL": f"http://127.0.0.1:{port}", "GLOVECAL_DATA": str(tmp_path / "none")}
    with triggered(away, protocol="natnet") as stage:
        stage.send(natnet("StartRecording"))
        assert stage.receive()[-4:] == b"\1\0\0\0"
        stage.send(natnet("StopRecording"))
        settings = {"GLOVECAL_DATA": str(tmp_path / "data"), "GLOVECAL_ZENOH": free_endpoint()}
        process = start(settings | {"GLOVECAL_PORT": port, "GLOVECAL_STUDIO": "no"}, "serve")
        try:
            assert stage.receive()[-4:] == b"\1\0\0\0", "nothing was going on"
        finally:
            end(process)
    assert stage.complaints.splitlines() == [
        "The service does not answer (No service); trying on.",
        "No recording began: the service did not answer for 10 s.",
        "The service does not answer (No service); trying on.",
        "natnet (127.0.0.1): the end of a recording, but no trigger began one here.",
    ]
