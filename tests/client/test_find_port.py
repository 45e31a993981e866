"""Which port has a CyberGlove: every kind of port at once, and as JSON."""

import json
import sys
import time
from pathlib import Path

import pytest

from glovecal_client.capture.cyberglove import find_port
from glovecal_client.capture.cyberglove.device import CyberGlove
from glovecal_client.capture.cyberglove.find_port import find_ports, only_cyberglove, probe
from glovecal_client.errors import DeviceError, DeviceLost
from glovecal_service.emulators.cyberglove import EmulatedBox

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are a POSIX thing")


@pytest.fixture(autouse=True)
def _no_real_ports(monkeypatch: pytest.MonkeyPatch) -> None:
    """The ports of the computer that runs the tests are nobody's business."""
    monkeypatch.setattr(find_port, "_listed_ports", dict)


def test_all_kinds_of_ports(emulate, tmp_path: Path) -> None:
    gloves = {
        "glove-a": emulate(EmulatedBox(22, right_hand=False), name="glove-a"),
        "glove-b": emulate(EmulatedBox(18, baud=9600), name="glove-b"),
        "left-streaming": emulate(EmulatedBox(18), name="left-streaming"),
        "text": emulate(persona="text", name="text"),
        "noise": emulate(persona="noise", name="noise"),
        "silent": emulate(persona="silent", name="silent"),
        "echo": emulate(persona="echo", name="echo"),
    }
    gloves["left-streaming"].box.feed(b"D\x01S", time.monotonic())
    found = {Path(port.path).name: port for port in find_ports([str(tmp_path / "*"), "/dev/not-there"])}
    assert {name: port.kind for name, port in found.items()} == {
        "glove-a": "cyberglove",
        "glove-b": "cyberglove",
        "left-streaming": "cyberglove",
        "text": "text",
        "noise": "unreadable",
        "silent": "silent",
        "echo": "echo",
        "not-there": "unusable",
    }
    a, b = found["glove-a"], found["glove-b"]
    assert (a.layout, a.hand, a.baud, a.simulated) == ("cyberglove22", "left", 115200, True)
    assert (b.layout, b.hand, b.baud) == ("cyberglove18", "right", 9600)
    assert a.sentence == "CyberGlove with 22 sensors, left hand, firmware 0.2, simulated at 115200 baud"
    assert gloves["text"].received == b"", "a port that talks by itself must not be written to"
    assert gloves["noise"].received == b""
    assert json.loads(json.dumps([port.to_json() for port in found.values()]))[0]["path"]


def test_a_loose_glove_and_a_busy_port_are_told(emulate) -> None:
    emulator = emulate()
    emulator.box.glove_plugged = False
    assert probe(emulator.path).sentence.endswith("the glove is not plugged into its control box")
    emulator.box.glove_plugged = True
    glove = CyberGlove(emulator.path)
    glove.open()
    assert "in use by another program" in probe(emulator.path).sentence
    glove.close()


def test_no_ports_at_all() -> None:
    assert find_ports() == []
    with pytest.raises(DeviceLost, match="no CyberGlove found"):
        only_cyberglove()


def test_the_only_glove_is_taken_without_naming_its_port(emulate, monkeypatch: pytest.MonkeyPatch) -> None:
    emulator = emulate()
    ports = {emulator.path: ("", "")}
    monkeypatch.setattr(find_port, "_listed_ports", lambda: dict(ports))
    glove = CyberGlove.from_options(None, {})
    glove.open()
    assert glove.read(2.0) is not None
    glove.close()
    ports[emulate(name="second").path] = ("", "")
    with pytest.raises(DeviceError, match="say which, as in cyberglove:"):
        glove.open()


def test_the_computers_own_ports_can_be_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    assert all(isinstance(path, str) for path in find_port._listed_ports())
