"""Bytes written by hand after the fact sheet, and what each driver must read in them."""

from __future__ import annotations

import struct
import zlib
from itertools import pairwise
from pathlib import Path

import pytest
from glove_logs import LAYOUT_22, line_device

from glovecal_client.capture.cyberglove3.device import CyberGlove3
from glovecal_client.capture.device import build_device
from glovecal_client.capture.homunculus import Homunculus
from glovecal_client.capture.lucidglove import LucidGlove
from glovecal_client.capture.opencyberglove import OpenCyberGlove
from glovecal_client.capture.stream.parser import Sample
from glovecal_client.errors import BadOption
from glovecal_models.layout import Layout


def samples(device, data: bytes) -> list[Sample]:
    return device.new_parser().feed(data)


@pytest.mark.parametrize(
    ("line", "values"),
    [
        (b"A2047B1011C1200D1811E900F2047G2047P0", (2047, 1011, 1200, 1811, 900)),
        (b"E5D4C3B2A1", (1, 2, 3, 4, 5)),  # any order
        (b"A0B0C0D0E0F2047G2047P0HIJKLMNO", (0, 0, 0, 0, 0)),
        (b"A1B2C3D4E5(AB)2047(BB)0(CB)1(DB)2(EB)3\r", (1, 2, 3, 4, 5)),
        (b"A1B2C3D4E5(ZV)12(ZH)1Z", (1, 2, 3, 4, 5)),  # keys that are not known here
        (b"A1B2C3D4", None),  # a finger is missing
        (b"A1B2C3D4E4096", None),  # above the converter's range
        (b"A1000B4095C2000D2100E2200F2047G2047P4096I", (1000, 4095, 2000, 2100, 2200)),  # its trigger is not
        (b"A1B2C3D4E5F99999999999999999999", None),  # no counter has twenty digits
        (b"A1B2C3D4E5A1", None),  # a key twice
        (b"A01B2C3D4E5", None),  # no firmware prints leading zeros
        (b"A-1B2C3D4E5", None),
        (b"A1B2C3D4E5J7", None),  # flags carry no digits
        (b"AB2C3D4E5", None),
        (b"A1 B2C3D4E5", None),
        (b"(A1B2C3D4E5", None),
    ],
)
def test_alpha_lines(line: bytes, values: tuple[int, ...] | None) -> None:
    device = LucidGlove.from_options("nowhere", {})
    found = samples(device, b"\n" + line + b"\n")
    assert [sample.values for sample in found] == ([] if values is None else [values])
    assert device.counters.bad_frames == (values is None)


def test_buttons_splay_and_joints() -> None:
    assert samples(LucidGlove.from_options("nowhere", {}), b"\nA1B2C3D4E5JK\n")[0].button
    splay = LucidGlove.from_options("nowhere", {"sensors": "splay", "layout": "my-splay"})
    assert splay.sensors[5:] == ("T_SPLAY", "I_SPLAY", "M_SPLAY", "R_SPLAY", "P_SPLAY")
    line = b"\nA1B2C3D4E5(AB)6(BB)7(CB)8(DB)9(EB)10\n"
    assert samples(splay, line)[0].values == (1, 2, 3, 4, 5, 6, 7, 8, 9, 10)
    joints = LucidGlove.from_options("nowhere", {"sensors": "joints", "layout": "my-joints"})
    fields = [
        f"({finger}A{joint}){10 * n + m}"
        for n, finger in enumerate("ABCDE")
        for m, joint in enumerate("ABCD")
    ]
    assert samples(joints, f"\nA1B2C3D4E5{''.join(fields)}\n".encode())[0].values[5:9] == (0, 1, 2, 3)


def test_senseshift_leaves_out_first_joints_and_zeros() -> None:
    """Its firmware sends each finger with its splay and its joints 2 to 4, none of them where it is 0."""
    line = b"\nA10(AB)2047(AAB)11B20(BAC)21C30D40E50(EB)1\n"
    splay = LucidGlove.from_options("nowhere", {"sensors": "splay", "layout": "my-splay"})
    assert samples(splay, line)[0].values == (10, 20, 30, 40, 50, 2047, 0, 0, 0, 1)
    joints = LucidGlove.from_options("nowhere", {"sensors": "joints", "layout": "my-joints"})
    values = samples(joints, line)[0].values
    assert values[5:13] == (10, 11, 0, 0, 20, 0, 21, 0)
    assert samples(joints, b"\n(AAB)11B20C30D40E50\n") == []  # the finger itself is never left out


@pytest.mark.parametrize(
    ("line", "values"),
    [
        (b"1&2&3&4&5&512&512&0&0&1&0&0&0", (1, 2, 3, 4, 5)),
        (b"1&2&3&4&5&512&512&0&0&1&0&0", None),
        (b"1&2&3&4&1024&512&512&0&0&1&0&0&0", None),  # an AVR has 1023 at most
        (b"1&2&3&4&5&512&512&2&0&1&0&0&0", None),  # a button is 0 or 1
        (b"1&2&3&&5&512&512&0&0&1&0&0&0", None),
    ],
)
def test_legacy_lines(line: bytes, values: tuple[int, ...] | None) -> None:
    device = LucidGlove.from_options("nowhere", {"encoding": "legacy", "largest": "1023"})
    found = samples(device, b"\n" + line + b"\n")
    assert [sample.values for sample in found] == ([] if values is None else [values])
    assert all(sample.button for sample in found)


def test_homunculus_lines() -> None:
    device = Homunculus.from_options("nowhere", {})
    numbers = tuple(range(1450, 1466))
    text = " ".join(map(str, numbers)).encode()
    assert [sample.values for sample in samples(device, b"17\n" + text + b"\r\n" + text + b" 1\n")] == [
        numbers
    ]
    assert device.counters.bad_frames == 1
    assert len(device.sensors) == 16
    assert device.sensors[:5] == ("T_CMC", "T_MCP", "T_PIP", "T_DIP", "I_ABD")


def packet(values: list[int], *, temperature: float = 30.5, ticks: int = 77, tail: bytes = bytes(8)) -> bytes:
    covered = (
        struct.pack("<19i", *values) + struct.pack("<9f", *range(9)) + struct.pack("<fI", temperature, ticks)
    )
    assert len(covered) == 120
    return covered + tail + struct.pack("<I", zlib.crc32(covered))


def test_opencyberglove_packets() -> None:
    values = [*range(0, 18 * 900, 900), 16384]
    device = OpenCyberGlove.from_options("nowhere", {"context": "temperature_c"})
    good = packet(values, tail=b"\x01\x02\x03\x04\x05\x06\x07\x08")
    wrong_sum = good[:-1] + bytes([good[-1] ^ 1])
    found = samples(device, good[50:] + good + wrong_sum + packet([*values[:-1], 16385]) + good)
    assert [sample.values for sample in found] == [tuple(values)] * 2
    assert (found[0].ticks, found[0].context) == (77, (30.5,))
    assert device.counters.bad_frames == 1


def cg3_record(stamp: bytes = b"12:34:56:29:2S", words: tuple[int, ...] = tuple(range(1, 23))) -> bytes:
    return stamp + struct.pack(">22H", *words) + b"\r\n\0"


def test_cyberglove3_records() -> None:
    device = CyberGlove3.from_options("nowhere", {})
    # In hardware order 1 to 22: thumb roll, MCP, IP, thumb-index abduction, index MCP, PIP, DIP ...
    expected = (1, 4, 2, 3, 5, 6, 11, 8, 9, 12, 13, 15, 16, 17, 19, 20, 21, 22, 7, 10, 14, 18)
    assert device.sensors == LAYOUT_22
    (one,) = samples(device, b"1S" + b"2S" + cg3_record())  # echo, and a stray rest as seen in use
    assert one.values == expected
    assert one.ticks == ((12 * 3600 + 34 * 60 + 56) * 30 + 29) * 3 + 2
    largest = tuple([0x0FFF] * 22)
    assert samples(device, cg3_record(words=largest))[0].values == largest


@pytest.mark.parametrize(
    "record",
    [
        cg3_record(words=(0, *range(2, 23))),  # 0 is no reading
        cg3_record(words=(0x1000, *range(2, 23))),  # more than 12 bits
        cg3_record()[:-1] + b"\x01",
        cg3_record()[:40],
        cg3_record(b"24:00:00:00:0S"),
        cg3_record(b"12:34:60:00:0S"),
        cg3_record(b"12:34:56:31:0S"),
    ],
)
def test_cyberglove3_records_that_are_damaged(record: bytes) -> None:
    device = CyberGlove3.from_options("nowhere", {})
    assert len(samples(device, cg3_record() + record + cg3_record())) == 2


def test_cyberglove3_with_18_sensors_has_no_dip_words() -> None:
    device = CyberGlove3.from_options("nowhere", {"layout": "cyberglove3-18"})
    words = tuple(0 if place in (6, 9, 13, 17) else place + 1 for place in range(22))
    (one,) = samples(device, cg3_record(words=words))
    assert one.values == (1, 4, 2, 3, 5, 6, 11, 8, 9, 12, 13, 15, 16, 17, 19, 20, 21, 22)


NMEA = b"$1000,1,2,3,4,5,7400*"


def test_described_lines(tmp_path: Path) -> None:
    device = line_device(tmp_path)
    check = 0
    for byte in NMEA[1:-1]:
        check ^= byte
    (one,) = samples(
        device, b"\n" + NMEA + f"{check:02x}\r\n".encode() + NMEA + f"{check ^ 1:02x}\n".encode()
    )
    assert (one.values, one.ticks) == ((1, 2, 3, 4, 5), 1000)
    assert one.context == pytest.approx((7.4,))
    assert device.context == ("supply_v",)
    assert device.notice == "readings in counts"


@pytest.mark.parametrize(
    ("text", "line", "values"),
    [
        ('[line]\ncolumns = ["A", "B"]\n', b"1.5,-2", (1.5, -2)),
        ('[line]\ncolumns = ["A", "-", "B"]\nseparator = ";"\n', b"1;x;3", (1, 3)),
        ('[line]\ncolumns = ["A", "B"]\nseparator = " "\n', b"1    2", (1, 2)),
        ('[line]\ncolumns = ["A", "B"]\n[checksum]\nkind = "sum"\ndigits = "decimal"\n', b"1,2*143", (1, 2)),
        ('[line]\ncolumns = ["A"]\n[checksum]\nkind = "crc16"\n', b"123456789*29B1", (123456789,)),
        ('[line]\ncolumns = ["A"]\n[checksum]\nkind = "crc32"\n', b"123456789*cbf43926", (123456789,)),
        (
            '[line]\nstart = "#"\ncolumns = ["A"]\n[checksum]\nkind = "sum"\ncovers_start = true\n',
            b"#1*54",
            (1,),
        ),
        ('[line]\ncolumns = ["A", "B"]\n[values]\nlowest = 0\nhighest = 9\n', b"1,10", None),
        ('[line]\ncolumns = ["A", "B"]\n', b"1,2,3", None),
        ('[line]\ncolumns = ["A", "B"]\n', b"1,nan", None),
        ('[line]\ncolumns = ["A", "B"]\n', b"1,1e3", (1, 1000)),
        ('[line]\ncolumns = ["A", "B"]\n', b"2.4420024420024422,-1.2e-05", (2.4420024420024422, -1.2e-05)),
        ('[line]\ncolumns = ["A", "B"]\n', b"12345678901234567890,.5", (12345678901234567890.0, 0.5)),
        ('[line]\ncolumns = ["A", "B"]\n', b"1,1e400", None),
        ('[line]\ncolumns = ["A", "B"]\n', b"1,0x10", None),
        ('[line]\ncolumns = ["A", "B"]\n', b"1,1_0", None),
        ('[line]\ncolumns = ["A", "t"]\n[time]\ncolumn = "t"\n', b"1,-1", None),
    ],
)
def test_descriptions(tmp_path: Path, text: str, line: bytes, values: tuple[float, ...] | None) -> None:
    found = samples(line_device(tmp_path, text), b"\n" + line + b"\n")
    assert [sample.values for sample in found] == ([] if values is None else [values])


def test_lines_that_end_with_a_carriage_return_alone(tmp_path: Path) -> None:
    device = line_device(tmp_path, '[line]\nend = "\\r"\ncolumns = ["A", "B"]\n')
    assert [sample.values for sample in samples(device, b"cut\r1,2\r3,4\r")] == [(1, 2), (3, 4)]
    other = line_device(tmp_path, '[line]\ncolumns = ["A", "B"]\n')
    assert samples(other, b"cut\n" + 200 * b"1,2\r") == []
    assert "each ends with a carriage return alone?" in other.counters.last_refused


def test_one_finger_a_line_finds_its_rhythm_again(tmp_path: Path) -> None:
    device = line_device(tmp_path, "[line]\npattern = 'thumb=(?P<T>.)\\nindex=(?P<I>.)'\nlines = 2\n")
    found = samples(device, b"cut\nindex=9\nthumb=1\nindex=2\nthumb=3\nthumb=4\nindex=5\n")
    assert [sample.values for sample in found] == [(1, 2), (4, 5)]
    assert device.counters.bad_frames == 2


@pytest.mark.parametrize(
    ("text", "line", "why"),
    [
        ('[line]\ncolumns = ["A", "B"]\n', b"1,nan", "'1,nan': B is 'nan', not a number"),
        ('[line]\ncolumns = ["A", "B"]\n', b"1,2,3", "'1,2,3': 3 fields, not 2"),
        ('[line]\ncolumns = ["A"]\n[values]\nhighest = 9\n', b"10", "'10': A is 10, above 9"),
        ('[line]\nstart = "$"\ncolumns = ["A"]\n', b"10", "'10': it does not begin with '$'"),
        ("[line]\npattern = 'x(?P<A>.)'\n", b"y1", "'y1': it does not match line.pattern"),
        ('[line]\ncolumns = ["A"]\n[checksum]\nkind = "xor"\n', b"1*00", "'1*00': its checksum is wrong"),
        ('[line]\ncolumns = ["A"]\n', b"\xff", "'\\\\xff': A is '\\\\xff', not a number"),
    ],
)
def test_a_refused_line_tells_the_field_and_why(tmp_path: Path, text: str, line: bytes, why: str) -> None:
    device = line_device(tmp_path, text)
    assert samples(device, b"\n" + line + b"\n") == []
    assert device.counters.last_refused == why


@pytest.mark.parametrize(
    ("unit", "stamps"),
    [
        ("us", (b"999960000", b"999980000", b"1000000000", b"1000020000")),
        ("us", (b"4294940000", b"4294960000", b"12704", b"32704")),  # wraps at 2^32
        ("s", (b"12.000", b"12.020", b"12.040", b"12.060")),
        ("s", (b"1787654321.000", b"1787654321.020", b"1787654321.040", b"1787654321.060")),
        ("ms", (b"1787654321000", b"1787654321020", b"1787654321040", b"1787654321060")),
        ("ms", (b"1.5e3", b"1520.0", b"1540", b"1560")),
    ],
)
def test_a_time_keeps_its_digits(tmp_path: Path, unit: str, stamps: tuple[bytes, ...]) -> None:
    text = f'[line]\ncolumns = ["t", "A"]\n[time]\ncolumn = "t"\nunit = "{unit}"\n'
    device = line_device(tmp_path, text)
    found = samples(device, b"\n" + b"".join(stamp + b",7\r\n" for stamp in stamps))
    clock = device.new_clock()
    assert clock is not None
    times, now_ns = [], 10**12
    for sample in found:
        assert sample.ticks is not None
        times.append(clock.monotonic_ns(sample.ticks, now_ns + 5_000_000 * len(times)))
        now_ns += 20_000_000
    steps = [later - early for early, later in pairwise(times)]
    assert steps == pytest.approx([20_000_000] * 3, abs=20_000)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "line.columns must list the columns by name"),
        ('[line]\ncolumns = ["A", "A"]', "names 'A' more than once"),
        ('[line]\ncolumns = ["-"]', "names no sensor"),
        ('[line]\ncolumns = ["A"]\nseperator = ";"', "unknown key line.seperator; did you mean 'separator'"),
        ('[line]\ncolumns = ["A"]\n[checksum]\nkind = "md5"', "'md5' must be one of xor, sum, crc16, crc32"),
        ('[line]\ncolumns = ["A"]\n[time]\ncolumn = "t"', "time.column = 't' is none of the columns A"),
        ('[line]\ncolumns = ["A"]\n[context]\nv = 3', "context.v must be"),
        ('rate_hz = "fast"\n[line]\ncolumns = ["A"]', "rate_hz = 'fast' must be a number"),
        ('rate_hz = 0\n[line]\ncolumns = ["A"]', "rate_hz = 0.0 must be a positive number"),
        ("line = 3", "line must be a table"),
        ('[line]\ncolumns = ["1st"]', "'1st' is not a channel name"),
        ("[line", "is not TOML"),
        (
            "[line]\npattern = '('",
            "line.pattern is no regular expression: missing ), unterminated subpattern",
        ),
        ("[line]\npattern = '.*'", "names no column: write (?P<I_FLEX>[0-9]+)"),
        ("[line]\npattern = '(?P<A>.)'\ncolumns = ['A']", "leave line.columns out"),
        ('[line]\nlines = 2\ncolumns = ["A"]', "needs line.pattern"),
        ('[line]\nend = ";"\ncolumns = ["A"]', "line.end = ';' must be one of '\\n', '\\r'"),
    ],
)
def test_a_description_that_cannot_be(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(BadOption) as refused:
        line_device(tmp_path, text)
    assert sentence in str(refused.value)
    assert "glove.toml" in str(refused.value)


@pytest.mark.parametrize(
    ("device", "options", "sentence"),
    [
        ("lucidglove", {}, "say where the glove is, as in lucidglove:/dev/ttyUSB0"),
        ("lucidglove:tcp:x", {}, "'tcp:x' needs a port from 1 to 65535"),
        ("lucidglove:p", {"encoding": "beta"}, "encoding='beta' must be one of alpha, legacy"),
        ("lucidglove:p", {"sensors": "splay"}, "sensors=splay needs layout=NAME"),
        ("lucidglove:p", {"sensors": "splay", "encoding": "legacy"}, "encoding=legacy sends no splay"),
        ("lucidglove:p", {"rate": "3"}, "no option 'rate'; there are encoding="),
        ("homunculus:p", {"largest": "1.5"}, "largest=1.5 must be a whole number from 1 to 65535"),
        ("cyberglove3:p", {"multiplier": "5"}, "multiplier='5' must be a number from 1 to 4"),
        ("opencyberglove:p", {"clock": "sun"}, "clock='sun' must be one of computer, glove_us, glove_ms"),
        ("line", {}, "needs a description"),
        ("line:nowhere.toml", {"port": "p"}, "nowhere.toml cannot be read"),
        ("line:nowhere.toml", {}, "--option port="),
    ],
)
def test_options_that_cannot_be(device: str, options: dict[str, str], sentence: str) -> None:
    with pytest.raises(BadOption) as refused:
        build_device(device, options)
    assert sentence in str(refused.value)


@pytest.mark.parametrize("name", ["cyberglove3:p", "homunculus:p", "lucidglove:p", "opencyberglove:p"])
def test_the_sensors_of_a_device_are_those_of_its_layout(name: str) -> None:
    device = build_device(name)
    layout = Layout.built_in(device.layout)
    assert device.sensors == layout.sensors
    assert getattr(device, "counts", None) == layout.counts
