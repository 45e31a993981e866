"""The emulated box answers byte by byte what the fact sheet says; the driver is not involved."""

import pytest

from glovecal_service.emulators.cyberglove import BITS, HARDWARE_MASK, EmulatedBox
from glovecal_service.emulators.hand import SPAN_OF_BIT, counts_at

MASK18 = bytes([0x3F, 0xBB, 0x7B])
MASK22 = bytes([0x7F, 0xFF, 0x7F])


@pytest.mark.parametrize(
    ("sent", "answer"),
    [
        (b"?G", b"?G\x03\0"),
        (b"?S", b"?S\x12\0"),
        (b"?K", b"?K" + MASK18 + b"\0"),
        (b"?M", b"?M" + MASK18 + b"\0"),
        (b"?N", b"?N\x12\0"),
        (b"?B", b"?B\0\0"),
        (b"?R", b"?R\x01\0"),
        (b"?T", b"?T\x04\x80\x00\x01\0"),
        (b"?W", b"?W\0\0"),
        (b"?F", b"?F\x01\0"),
        (b"?U", b"?U\0\0"),
        (b"?D", b"?D\0\0"),
        (b"?P", b"?P\x81\xd8\0\0"),
        (b"U\x01", b"U\0"),
        (b"D\x01", b"D\0"),
        (b"N\x05", b"N\0"),
        (b"N\x20", b"en\0"),
        (b"U\x07", b"en\0"),
        (b"T\x05\xa0\x00\x01", b"T\0"),
        (b"M\x07\x00\x00?M", b"M\0?M\x07\0\0\0"),
        (b"\x03", b"\x03\0"),
        (b"\x09", b"\x09\r\n\0"),
        (b"X", b"e?\0"),
        (b"?X", b"e?\0"),
        (b"\r\n", b""),
        (b"u 1\r?U", b"u\r\n\0?U\x01\0"),
        (b"t 1440 1\r?T", b"t\r\n\0?T\x05\xa0\x00\x01\0"),
        (b"?n", b"?n  18\r\n\0"),
        (b"?t", b"?t1152   1\r\n\0"),
        (b"CO\x02\x50", b"CO\0"),
        (b"CG\x40\x50", b"en\0"),
        (b"CA" + bytes(range(36)) + b"?C", b"CA\0?C" + bytes(range(36)) + b"\0"),
        (b"A\x02\x00\x10\x05\x20?A", b"A\0?A\x10\0\0\0\0\x20\0"),
        (b"A\xff\x01\x02\x03\x04\x05\x06?A", b"A\0?A\x01\x02\x03\x04\x05\x06\0"),
        (b"E\x07\x55?E\x07", b"E\0?E\x07\x55\0"),
    ],
)
def test_answers(sent: bytes, answer: bytes) -> None:
    assert EmulatedBox().feed(sent, 0.0) == answer


def test_22_sensors_and_a_left_hand() -> None:
    box = EmulatedBox(22, right_hand=False)
    assert box.feed(b"?S?K?R", 0.0) == b"?S\x16\0?K" + MASK22 + b"\0?R\0\0"


def test_masks_have_as_many_bits_as_sensors_and_never_bit_7() -> None:
    for count, mask in HARDWARE_MASK.items():
        assert mask.bit_count() == count == len(BITS[count])
        assert not mask & 0x800080


@pytest.mark.parametrize("sensors", [18, 22])
def test_samples_have_the_fact_sheets_length_and_no_zero_before_the_end(sensors: int) -> None:
    box = EmulatedBox(sensors)
    bare = box.feed(b"G", 1.0)
    assert (bare[:1], len(bare), bare.index(0)) == (b"G", sensors + 2, sensors + 1)
    box.feed(b"U\x01", 1.0)
    assert len(box.feed(b"G", 1.0)) == sensors + 3
    box.feed(b"D\x01", 1.0)
    full = box.feed(b"G", 0.0)  # tick 0: every byte of the stamp is really zero
    assert len(full) == sensors + 8
    assert full[sensors + 1 : sensors + 6] == b"\x8f\x01\x01\x01\x01"
    assert full[-2] & 0x80
    text = box.feed(b"g", 1.0)
    assert len(text) == 1 + 4 * sensors + 3
    assert [int(text[1 + 4 * place : 5 + 4 * place]) for place in range(sensors)] == box.values(1.0)


def test_the_stream_keeps_its_period_and_ctrl_c_ends_it() -> None:
    box = EmulatedBox()
    box.feed(b"S", 0.0)
    box.due(1.0005)
    assert len(box.records) == 101
    assert box.feed(b"\x03", 1.0) == b"\x03\0"
    assert box.due(2.0) == b""


def test_too_fast_a_period_is_marked_and_sent_at_the_wires_pace() -> None:
    box = EmulatedBox(22)
    box.feed(b"T\x00\x10\x00\x01S", 0.0)
    box.due(1.0005)
    assert all(record[-3:] == b"es\0" for record in box.records)
    assert len(box.records) == 481


def test_a_word_of_zero_means_as_fast_as_possible() -> None:
    box = EmulatedBox(22)
    box.feed(b"T\x00\x00\x00\x01S", 0.0)
    box.due(1.0005)
    assert len(box.records) == 481
    assert all(record[-3:-1] != b"es" for record in box.records)


def test_a_loose_glove_is_marked_everywhere() -> None:
    box = EmulatedBox()
    box.glove_plugged = False
    assert box.feed(b"?G", 0.0) == b"?G\x01\0"
    assert box.feed(b"U\x01G", 0.0)[2:] == b"G" + bytes(18) + b"\x80eg\0"


def test_the_button_shows_in_the_status_byte_in_w_and_in_the_light() -> None:
    box = EmulatedBox()
    box.press(True)
    assert box.feed(b"?W?L", 0.0) == b"?W\x01\0?L\x01\0"
    assert box.feed(b"U\x01G", 0.0)[-2] == 0x87


def test_a_restart_is_silent_and_deaf_and_forgets() -> None:
    box = EmulatedBox()
    box.feed(b"U\x01S", 0.0)
    assert box.feed(b"\x12", 1.0) == b""
    assert box.feed(b"?U", 2.0) == b"" == box.due(2.7)
    assert box.due(2.75) == b"\x12\r\n\0"
    assert box.feed(b"?U", 2.8) == b"?U\0\0"


def test_external_sync_sends_one_record_a_pulse() -> None:
    box = EmulatedBox()
    box.feed(b"Y\x01S", 0.0)
    assert box.due(1.0) == b""
    assert box.sync_pulse(1.0)[:1] == b"Y"


def test_spans_lie_within_those_of_the_public_calibration_files() -> None:
    for bit, span in SPAN_OF_BIT.items():
        if span.low == 0 and span.counts_per_degree > 0 and bit != 20:
            assert 0.48 <= span.counts_per_degree <= 1.8
            assert 32 <= span.zero <= 117
            assert 72 <= span.count(span.high) <= 232
    assert all(1 <= count <= 255 for time_s in range(40) for count in counts_at(time_s / 4).values())
