"""What the operating system gives: Windows' way as far as it can be followed here, and this system's."""

from __future__ import annotations

import socket
import sys
import types
from collections.abc import Iterator
from pathlib import Path

import pytest

from glovecal_client import operating_system
from glovecal_client.capture import serial_link
from glovecal_client.capture.cyberglove import find_port
from glovecal_client.capture.stream import links
from glovecal_client.operating_system import boot, held_back_ms, lock_file, move_over, name_for_a_file

serial = pytest.importorskip("serial")


@pytest.fixture
def windows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(operating_system, "sys", types.SimpleNamespace(platform="win32"))


def test_a_lock_is_one_programs_until_it_closes_the_file(tmp_path: Path) -> None:
    with (tmp_path / "lock").open("ab") as first, (tmp_path / "lock").open("rb") as second:
        lock_file(first)
        with pytest.raises(OSError):  # noqa: PT011  # which one differs
            lock_file(second)
        first.close()
        lock_file(second)


@pytest.mark.usefixtures("windows")
def test_a_file_that_a_scanner_holds_for_a_moment_is_replaced_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, target = tmp_path / "new", tmp_path / "old"
    source.write_text("new")
    target.write_text("old")
    refusals = iter([PermissionError(13, "Access is denied"), PermissionError(13, "Access is denied")])
    real = Path.replace

    def replace(path: Path, to: Path) -> Path:
        for refusal in refusals:
            raise refusal
        return real(path, to)

    monkeypatch.setattr(Path, "replace", replace)
    move_over(source, target)
    assert target.read_text() == "new"
    assert not source.exists()


def test_on_other_systems_what_is_refused_is_refused_at_once(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        move_over(tmp_path / "not there", tmp_path / "target", durably=True)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("Take 1: fast.csv", "Take 1_ fast.csv"),
        ("con.csv", "_con.csv"),
        ("COM1", "_COM1"),
        ("lpt9.tar.gz", "_lpt9.tar.gz"),
        ("end. .", "end"),
        ("...", "_"),
        ("Übung ½.csv", "Übung ½.csv"),
        ("console.csv", "console.csv"),
    ],
)
def test_names_that_windows_has_not(windows: None, name: str, expected: str) -> None:
    assert name_for_a_file(name) == expected


def test_elsewhere_a_name_stays() -> None:
    assert name_for_a_file("Take 1: fast.csv") == "Take 1: fast.csv"


def test_the_boot_is_one() -> None:
    assert boot() == boot() != ""


class Key:
    """In the registry: one adapter at COM7, as FTDI's driver enters it."""

    def __init__(self, _root: int, place: str) -> None:
        if "VID" in place and not place.endswith(r"A50285BIA\0000\Device Parameters"):
            raise FileNotFoundError(2, "The system cannot find the file specified", place)

    def __enter__(self) -> Key:
        return self

    def __exit__(self, *_: object) -> None: ...


@pytest.fixture
def adapter(windows: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    registry = types.SimpleNamespace(
        HKEY_LOCAL_MACHINE=1,
        OpenKey=Key,
        QueryInfoKey=lambda _: (1, 0, 0),
        EnumKey=lambda _, number: ["VID_0403+PID_6001+A50285BIA"][number],
        QueryValueEx=lambda _, name: {"PortName": ("COM7", 1), "LatencyTimer": (16, 4)}[name],
    )
    monkeypatch.setitem(sys.modules, "winreg", registry)  # type: ignore[arg-type]
    serial_link._tell_what_is_held_back.cache_clear()
    yield
    serial_link._tell_what_is_held_back.cache_clear()


@pytest.mark.usefixtures("adapter")
def test_an_adapter_that_keeps_bytes_back_is_told_once(caplog: pytest.LogCaptureFixture) -> None:
    assert held_back_ms("COM8") == 0
    for _ in range(2):
        serial_link._tell_what_is_held_back("COM7")
    (said,) = caplog.messages
    assert said.startswith("COM7 hands bytes over every 16 ms: set its latency timer to 1 ms")


@pytest.mark.parametrize(
    ("told", "sentence"),
    [
        (
            "PermissionError(13, 'Zugriff verweigert', None, 5)",
            "COM3 is in use by another program: stop that first",
        ),
        (
            "FileNotFoundError(2, 'The system cannot find the file specified.', None, 2)",
            "there is no port COM3: plug the glove in, or look for its port with glovecal find-port",
        ),
        (
            "OSError(22, 'The semaphore timeout period has expired.', None, 121)",
            "nothing answers at COM3: is the glove switched on and near?",
        ),
        (
            "OSError(22, 'A device attached to the system is not functioning.', None, 31)",
            "the adapter at COM3 does not work: pull it out and plug it in again",
        ),
    ],
)
def test_why_a_com_port_does_not_open(told: str, sentence: str) -> None:
    """As pyserial's ``serialwin32`` puts Windows' errors."""
    error = serial.SerialException(f"could not open port 'COM3': {told}")
    assert serial_link._why_not_open("COM3", error) == sentence


def test_a_pattern_finds_com_ports_that_are_no_files(monkeypatch: pytest.MonkeyPatch) -> None:
    ports = {"COM3": ("USB Serial Port (COM3)", "0403:6001"), "COM12": ("", "")}
    monkeypatch.setattr(find_port, "_listed_ports", lambda: dict(ports))
    monkeypatch.setattr(find_port, "probe", lambda path, *_: path)
    assert find_port.find_ports(["COM*"]) == ["COM12", "COM3"]
    assert find_port.find_ports(["COM9"]) == ["COM12", "COM3", "COM9"]


class ResetOnce(socket.socket):
    """On Windows the call after a datagram that met a closed port."""

    refusals = 1

    def recvfrom(self, *arguments: int):
        if self.refusals:
            self.refusals -= 1
            raise ConnectionResetError(10054, "forcibly closed by the remote host")
        return super().recvfrom(*arguments)


def test_a_datagram_to_a_closed_port_loses_no_glove() -> None:
    with (
        ResetOnce(socket.AF_INET, socket.SOCK_DGRAM) as port,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as glove,
    ):
        port.bind(("127.0.0.1", 0))
        glove.sendto(b"1,2,3", port.getsockname())
        link = links._UdpLink(port)
        assert link.read(5.0) == b""
        assert link.read(5.0) == b"1,2,3\n"
