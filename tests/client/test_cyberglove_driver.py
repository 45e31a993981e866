"""The driver against the emulated box, byte by byte over a pseudo-terminal."""

import sys
import time

import numpy as np
import pytest
from cyberglove_emulator import CyberGloveEmulator
from hypothesis import given
from hypothesis import strategies as st
from test_cyberglove_order import places

from glovecal_client.capture.cyberglove.device import CyberGlove
from glovecal_client.capture.cyberglove.identity import SENSORS
from glovecal_client.capture.cyberglove.setup import period_payload, period_words, rate_of
from glovecal_client.capture.device import Device, Reading, build_device
from glovecal_client.errors import BadOption, DeviceError, DeviceLost
from glovecal_service.emulators.cyberglove import EmulatedBox

POSIX_ONLY = pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are a POSIX thing")
pytestmark = POSIX_ONLY
LONG_S = 60.0
"""For what comes at once, where the computer is not busy."""


def glove_on(emulator: CyberGloveEmulator, **options: str) -> CyberGlove:
    return CyberGlove.from_options(emulator.path, options)


def some_readings(glove: CyberGlove, count: int) -> list[Reading]:
    readings = [glove.read(LONG_S) for _ in range(count)]
    assert all(reading is not None for reading in readings)
    return [reading for reading in readings if reading is not None]


def in_layout_order(record: bytes, count: int) -> list[int]:
    """The values of a record sent, put into layout order by the table of the fact sheet."""
    value = {name: record[1 + place] for place, name in places(count).items()}
    return [value[name] for name in SENSORS[f"cyberglove{count}"]]


def read_until_lost(glove: CyberGlove) -> str:
    """Reads what is still there, until a read raises. Returns the sentence."""
    try:
        while glove.read(LONG_S) is not None:
            pass
    except DeviceLost as lost:
        return str(lost)
    pytest.fail("the loss was not noticed")


@pytest.mark.parametrize("timestamp", ["off", "on"])
@pytest.mark.parametrize("count", [18, 22])
def test_every_record_sent_is_read_value_by_value(emulate, count: int, timestamp: str) -> None:
    emulator = emulate(EmulatedBox(count, right_hand=count == 18))
    glove = glove_on(emulator, timestamp=timestamp, rate="200")
    assert isinstance(glove, Device)
    assert (glove.layout, glove.sensors) == (f"cyberglove{count}", SENSORS[f"cyberglove{count}"])
    assert glove.hand == ("right" if count == 18 else "left")
    assert glove.simulated
    emulator.box.records.clear()
    glove.open()
    readings = some_readings(glove, 60)
    sent = list(emulator.box.records)
    glove.close()
    assert [reading.readings.tolist() for reading in readings] == [
        in_layout_order(record, count) for record in sent[:60]
    ]
    assert all(reading.readings.dtype == np.float32 and reading.context.size == 0 for reading in readings)
    assert glove.counters.bad_frames == glove.counters.skipped_bytes == 0
    length = 1 + count + 5 * (timestamp == "on") + 1 + 1
    assert {len(record) for record in sent} == {length}


def test_the_commands_sent_are_those_of_the_fact_sheet(emulate) -> None:
    emulator = emulate()
    glove = CyberGlove(emulator.path)
    glove.open()
    some_readings(glove, 1)
    glove.close()
    assert emulator.received.startswith(b"\x03?S?K?R?G?Vi?M?N?Q?Y?D?UU\x01T\x04\x80\x00\x01S")


def test_times_follow_the_boxs_clock_when_its_stamps_are_on(emulate) -> None:
    emulator = emulate()
    glove = glove_on(emulator, timestamp="on")
    emulator.box.times.clear()
    glove.open()
    readings = some_readings(glove, 50)
    stamps = np.array([reading.monotonic_ns for reading in readings], float)
    sent = np.array(emulator.box.times[:50]) * 1e9
    glove.close()
    assert np.all(np.diff(stamps) > 0)
    settled = slice(10, None)  # the first records may have waited while the stream began
    # 200 parts per million are the clocks' allowed drift, 8.7 us one tick of the box.
    assert np.abs(np.diff(stamps) - np.diff(sent))[settled].max() < 0.25 * np.diff(sent).min()
    assert (stamps - sent)[settled].min() > -10_000
    assert all(abs(reading.wall_ns - time.time_ns()) < 60e9 for reading in readings)


def test_the_button_is_the_wrist_switch(emulate) -> None:
    emulator = emulate()
    glove = CyberGlove(emulator.path)
    glove.open()
    assert not some_readings(glove, 3)[-1].button
    emulator.box.press(True)
    assert any(reading.button for reading in some_readings(glove, 10))
    glove.close()


def test_twenty_times_unplugged_and_plugged_in_again(emulate) -> None:
    emulator = emulate()
    glove = glove_on(emulator)
    glove.open()
    for _ in range(20):
        some_readings(glove, 3)
        emulator.unplug()
        assert "is gone" in read_until_lost(glove)
        with pytest.raises(DeviceLost, match="there is no port"):
            glove.open()
        emulator.replug()
        glove.open()
        sent_from = len(emulator.box.records)
        values = [reading.readings.tolist() for reading in some_readings(glove, 3)]
        sent = [in_layout_order(record, 18) for record in emulator.box.records]
        assert all(value in sent for value in values)
        assert len(emulator.box.records) > sent_from
    glove.close()
    glove.close()
    with pytest.raises(DeviceLost, match="not open"):
        glove.read(0.0)


def test_silence_behind_the_adapter_is_a_loss(emulate) -> None:
    emulator = emulate()
    glove = CyberGlove(emulator.path)
    glove.open()
    some_readings(glove, 3)
    emulator.silenced = True
    assert "no bytes for" in read_until_lost(glove)
    emulator.silenced = False
    glove.open()
    some_readings(glove, 3)
    glove.close()


def test_a_stream_that_stops_is_asked_for_again(emulate) -> None:
    emulator = emulate()
    glove = CyberGlove(emulator.path)
    glove.open()
    some_readings(glove, 3)
    emulator.box.streaming = None
    some_readings(glove, 20)
    glove.close()


def test_a_glove_pulled_from_its_box_gives_no_frames_and_is_named(emulate) -> None:
    emulator = emulate()
    glove = CyberGlove(emulator.path)
    glove.open()
    some_readings(glove, 3)
    emulator.box.glove_plugged = False
    assert "not plugged into it" in read_until_lost(glove)
    assert glove.counters.bad_frames > 0
    with pytest.raises(DeviceLost, match="no glove is plugged"):
        glove.open()
    emulator.box.glove_plugged = True
    glove.open()
    assert all((reading.readings > 0).all() for reading in some_readings(glove, 5))
    glove.close()


def test_lost_and_pushed_in_bytes_cost_frames_and_never_make_one(emulate) -> None:
    emulator = emulate(seed=3)
    glove = glove_on(emulator, rate="400")
    glove.open()
    emulator.damage.lost = emulator.damage.burst = 0.003
    readings = some_readings(glove, 400)
    emulator.damage.lost = emulator.damage.burst = 0.0
    readings += some_readings(glove, 20)
    sent = {tuple(in_layout_order(record, 18)) for record in emulator.box.records}
    glove.close()
    assert all(tuple(reading.readings) in sent for reading in readings)
    counters = glove.counters
    assert counters.bad_frames >= counters.resyncs > 0
    assert counters.skipped_bytes > 0


def test_noise_pushed_in_between_is_skipped(emulate) -> None:
    emulator = emulate()
    glove = CyberGlove(emulator.path)
    glove.open()
    for size in (1, 19, 20, 21, 500, 3000):
        emulator.send(emulator._chance.randbytes(size))
        some_readings(glove, 4)
    readings = some_readings(glove, 5)
    sent = {tuple(in_layout_order(record, 18)) for record in emulator.box.records}
    assert all(tuple(reading.readings) in sent for reading in readings)
    glove.close()


def test_a_damaged_line_can_still_be_opened(emulate) -> None:
    emulator = emulate(seed=5)
    emulator.damage.lost, emulator.damage.replies_too = 0.004, True
    glove = CyberGlove(emulator.path)
    for _ in range(5):
        glove.open()
        some_readings(glove, 3)
    glove.close()


def test_what_an_earlier_program_left_behind_does_not_matter(emulate) -> None:
    box = EmulatedBox()
    emulator = emulate(box)
    box.feed(b"M\x07\x00\x00N\x02Q\x01D\x01U\x01L\x01S", time.monotonic())
    glove = glove_on(emulator)
    glove.open()
    readings = some_readings(glove, 5)
    glove.close()
    assert readings[0].readings.shape == (18,)
    assert not any(box.settings.flags[letter] for letter in "QDY")


@pytest.mark.parametrize("half", [b"T\x04", b"M", b"?", b"C", b"U"])
def test_half_a_command_left_in_the_box_does_not_matter(emulate, half: bytes) -> None:
    box = EmulatedBox()
    emulator = emulate(box)
    box.feed(half, time.monotonic())
    glove = CyberGlove(emulator.path)
    glove.open()
    some_readings(glove, 3)
    glove.close()


def test_a_hung_box_is_restarted(emulate) -> None:
    box = EmulatedBox(restart_silence_s=0.3)
    box.stuck = True
    glove = glove_on(emulate(box), baud="115200", layout="cyberglove18")
    glove.open()
    some_readings(glove, 3)
    glove.close()


def test_the_baud_rate_is_found_and_the_rate_lowered_to_what_fits(emulate) -> None:
    glove = CyberGlove(emulate(EmulatedBox(22, baud=9600)).path)
    glove.open()
    some_readings(glove, 5)
    glove.close()
    assert glove.rate_hz == pytest.approx(36, abs=0.1)  # 25 bytes of 10 bits: 38.4 Hz at most
    assert "leaves room for 38 Hz" in glove.notice


def test_a_rate_that_does_not_fit_is_refused_with_the_ceiling(emulate) -> None:
    emulator = emulate(EmulatedBox(22))
    with pytest.raises(
        BadOption, match=r"500 Hz is not reachable: a record of 25 bytes at 115200 baud .* 461 Hz"
    ):
        glove_on(emulator, rate="500")
    with pytest.raises(BadOption, match="Leaving out the time stamp"):
        glove_on(emulator, rate="400", timestamp="on")


@given(st.floats(0.5, 1000))
def test_period_words_are_the_nearest_to_the_rate(rate: float) -> None:
    """Rounded to whole ticks, then to a multiple of the second word."""
    words = period_words(rate)
    assert all(1 <= word <= 0xFFFF for word in words)
    assert abs(words[0] * words[1] - 115200 / rate) <= 0.5 + words[1] / 2
    assert rate_of(words) == 115200 / (words[0] * words[1])


@pytest.mark.parametrize(
    ("rate", "words"),
    [(100, (1152, 1)), (80, (1440, 1)), (75, (1536, 1)), (60, (1920, 1)), (45, (2560, 1)), (2, (57600, 1))],
)
def test_period_words_are_the_fact_sheets(rate: int, words: tuple[int, int]) -> None:
    assert period_words(rate) == words
    assert period_payload(words) == bytes([words[0] >> 8, words[0] & 0xFF, 0, 1])


def test_a_box_without_status_byte_is_read_all_the_same(emulate) -> None:
    class OldBox(EmulatedBox):
        """Answers e? to U, as a box that has no such command."""

        def _run(self, command: bytes, now_s: float) -> bytes:
            return b"e?\0" if command in (b"U\x01", b"?U") else super()._run(command, now_s)

    glove = CyberGlove(emulate(OldBox()).path)
    glove.open()
    some_readings(glove, 10)
    glove.close()
    assert glove.counters.bad_frames == 0


def test_another_layout_than_asked_for_is_refused(emulate) -> None:
    glove = glove_on(emulate(EmulatedBox(22)), layout="cyberglove18")
    with pytest.raises(DeviceError, match="has 22 sensors, but layout cyberglove18 was expected"):
        glove.open()


def test_a_glove_of_another_size_after_replugging_is_refused(emulate) -> None:
    emulator = emulate()
    glove = CyberGlove(emulator.path)
    glove.open()
    emulator.unplug()
    read_until_lost(glove)
    emulator.box = EmulatedBox(22)
    emulator.replug()
    with pytest.raises(DeviceError, match="start again with the option layout=cyberglove22"):
        glove.open()


def test_a_glove_that_comes_later(emulate) -> None:
    emulator = emulate()
    emulator.unplug()
    glove = glove_on(emulator)
    assert glove.layout == "cyberglove18"
    with pytest.raises(DeviceLost, match="there is no port"):
        glove.open()
    emulator.replug()
    glove.open()
    some_readings(glove, 2)
    glove.close()


def test_two_programs_do_not_share_a_port(emulate) -> None:
    emulator = emulate()
    first, second = CyberGlove(emulator.path), CyberGlove(emulator.path)
    first.open()
    with pytest.raises(DeviceLost, match="in use by another program"):
        second.open()
    some_readings(first, 3)
    first.close()


def test_the_device_is_installed_under_its_name(emulate) -> None:
    device = build_device(f"cyberglove:{emulate(EmulatedBox(22)).path}")
    assert (device.name, device.layout, len(device.sensors)) == ("cyberglove", "cyberglove22", 22)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"bauds": "1"}, r"no option 'bauds'; there are baud=auto\|115200"),
        ({"baud": "300"}, "baud must be one of auto, 115200, 38400, 19200, 9600, not '300'"),
        ({"rate": "nan"}, "rate must be a number of Hz from 0.5 to 1000, not 'nan'"),
        ({"rate": "fast"}, "not 'fast'"),
        ({"layout": "lucidglove"}, "layout must be one of auto, cyberglove18, cyberglove22"),
        ({"timestamp": "yes"}, "timestamp must be one of off, on, not 'yes'"),
    ],
)
def test_options_are_checked(options: dict[str, str], sentence: str) -> None:
    with pytest.raises(BadOption, match=sentence):
        CyberGlove.from_options("/dev/nowhere", options)


def test_without_pyserial_a_sentence_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "serial", None)
    with pytest.raises(DeviceError, match=r"a serial glove needs pyserial, .* install .*pyserial"):
        CyberGlove("/dev/nowhere").open()
