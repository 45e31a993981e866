"""What is said of a port that gives no CyberGlove; never a frame, and the likely cause by name."""

import sys

import pytest
from cyberglove_emulator import Persona

from glovecal_client.capture.cyberglove.connection import Heard, explain
from glovecal_client.capture.cyberglove.device import CyberGlove
from glovecal_client.capture.cyberglove.setup import CyberGloveOptions
from glovecal_client.errors import DeviceError, DeviceLost
from glovecal_service.emulators.cyberglove import EmulatedBox

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are a POSIX thing")


def sentence(path: str, **options: str) -> str:
    """The verdict on opening; a read afterwards must give nothing."""
    glove = CyberGlove.from_options(path, {"layout": "cyberglove18"} | options)
    with pytest.raises(DeviceError) as refused:
        glove.open()
    with pytest.raises(DeviceLost, match="not open"):
        glove.read(0.0)
    return str(refused.value)


def exhaust(glove: CyberGlove) -> None:
    while True:
        glove.read(0.5)


def test_a_wrong_fixed_baud_rate(emulate) -> None:
    said = sentence(emulate(EmulatedBox(baud=19200)).path, baud="115200")
    assert "most likely the baud rate is wrong" in said
    assert "at 115200 baud" in said


@pytest.mark.parametrize(
    ("persona", "words"),
    [
        ("text", "sends LucidGlove lines"),
        ("noise", "no CyberGlove's at any of 115200, 38400, 19200, 9600 baud: most likely another device"),
        ("echo", "sends back what is written to it"),
    ],
)
def test_another_device(emulate, persona: Persona, words: str) -> None:
    assert words in sentence(emulate(persona=persona).path)


def test_a_box_that_is_off_counts_as_lost_and_is_named(emulate) -> None:
    glove = CyberGlove(emulate(persona="silent").path, CyberGloveOptions(baud=115200))
    with pytest.raises(DeviceLost, match=r"nothing answers on .* is the control box switched on"):
        glove.open()


def test_another_device_on_the_port_of_a_glove_counts_as_lost(emulate) -> None:
    emulator = emulate()
    glove = CyberGlove.from_options(emulator.path, {"baud": "115200"})
    glove.open()
    assert glove.read(2.0) is not None
    emulator.persona = "noise"
    with pytest.raises(DeviceLost, match="only unreadable bytes"):
        exhaust(glove)
    with pytest.raises(DeviceLost, match="unreadable bytes"):
        glove.open()


def test_a_glove_with_an_unknown_number_of_sensors(emulate) -> None:
    class Sixteen(EmulatedBox):
        def _answer(self, letter: bytes, command: bytes) -> bytes | None:
            return b"\x10" if letter == b"S" else super()._answer(letter, command)

    assert "it has 16 sensors; gloves with 18 and 22 are known" in sentence(emulate(Sixteen()).path)


def test_a_glove_with_an_unknown_mask(emulate) -> None:
    class Masked(EmulatedBox):
        def _answer(self, letter: bytes, command: bytes) -> bytes | None:
            return b"\xff\xff\x03" if letter == b"K" else super()._answer(letter, command)

    assert "mask is 0x03FFFF; with 18 sensors it should be 0x7BBB3F" in sentence(emulate(Masked()).path)


@pytest.mark.parametrize(
    ("came", "words"),
    [
        (b"login: \r\nlogin: ", "another device: at 115200 baud it sends text such as 'login:'"),
        (b"12:34:56:07:0S" + bytes(range(40)), "a CyberGlove III left streaming"),
        (b"\xff\x80\x12", "most likely the baud rate is wrong"),
        (b"S?S", "sends back what is written to it"),
    ],
)
def test_sentences(came: bytes, words: str) -> None:
    assert words in explain("COM3", [Heard(115200, b"?S", came)])
