"""Replaying native logs and take tables."""

from __future__ import annotations

import re
import time
from pathlib import Path

import numpy as np
import pytest

from glovecal_client import Frame, FrameLog, encode_frame
from glovecal_client.capture.device import Reading, build_device
from glovecal_client.capture.replay import ReplayDevice
from glovecal_client.errors import BadOption, DeviceFinished
from glovecal_models.takes.table import read_takes

TABLE = """time_s,take,s.A,s.B,r.A,c.supply_v
10.00,one,1,2,0.5,4.9
10.01,one,3,4,,
10.02,one,5,,0.5,5.0
0.00,two,7,8,0.5,4.8
0.01,two,9,10,0.5,4.8
"""


def table(tmp_path: Path, text: str = TABLE) -> Path:
    path = tmp_path / "half-hand.csv"
    path.write_text(text, encoding="utf-8")
    return path


def log(tmp_path: Path, frames: int = 20, period_ns: int = 10_000_000) -> Path:
    meta = {
        "layout": "two",
        "sensors": ["A", "B"],
        "context": ["supply_v"],
        "simulated": True,
        "hand": "left",
    }
    written = FrameLog.create(tmp_path / "run.glvlog", meta)
    for i in range(frames):
        values = np.array([i, 2 * i], np.float32)
        context = np.array([5 - i], np.float32)
        written.append(encode_frame(Frame(i, 9, i * period_ns, 0, values, context, flags=i % 2)))
    written.close()
    return written.path


def play(device: ReplayDevice, most: int = 10_000) -> list[Reading]:
    device.open()
    readings: list[Reading] = []
    try:
        while len(readings) < most:
            reading = device.read(0.05)
            if reading is not None:
                readings.append(reading)
    except DeviceFinished:
        pass
    device.close()
    return readings


def test_table_says_what_it_holds_and_gives_every_row(tmp_path: Path) -> None:
    device = ReplayDevice(table(tmp_path), speed=10)
    assert (device.sensors, device.context, device.layout) == (("A", "B"), ("supply_v",), "half-hand")
    assert device.rate_hz == pytest.approx(1000)
    assert not device.simulated
    readings = play(device)
    expected = [[1, 2], [3, 4], [5, np.nan], [7, 8], [9, 10]]
    np.testing.assert_array_equal([reading.readings for reading in readings], expected)
    np.testing.assert_array_equal(
        [reading.context[0] for reading in readings], np.array([4.9, np.nan, 5.0, 4.8, 4.8], np.float32)
    )


def test_log_is_replayed_with_the_times_of_now_at_its_own_pace(tmp_path: Path) -> None:
    device = build_device(f"replay:{log(tmp_path)}", {"speed": "2"})
    assert isinstance(device, ReplayDevice)
    assert (device.layout, device.hand, device.simulated) == ("two", "left", True)
    assert device.rate_hz == pytest.approx(200)
    before = time.monotonic_ns()
    readings = play(device)
    assert [reading.readings[1] for reading in readings] == [2 * i for i in range(20)]
    assert [reading.context[0] for reading in readings] == [5 - i for i in range(20)]
    assert [reading.button for reading in readings] == [i % 2 == 1 for i in range(20)]
    times = np.array([reading.monotonic_ns for reading in readings])
    assert times[0] >= before
    assert (np.diff(times) > 0).all()
    assert times[-1] - times[0] >= 19 * 5_000_000 * 0.9


def test_loop_starts_again_and_reopening_starts_from_the_beginning(tmp_path: Path) -> None:
    device = ReplayDevice(log(tmp_path, frames=4), speed=50, loop=True)
    assert [reading.readings[0] for reading in play(device, most=10)] == [0, 1, 2, 3, 0, 1, 2, 3, 0, 1]
    assert [reading.readings[0] for reading in play(device, most=2)] == [0, 1]


def test_damaged_tail_of_a_log_is_not_replayed(tmp_path: Path) -> None:
    path = log(tmp_path)
    path.write_bytes(path.read_bytes()[:-5])
    assert len(play(ReplayDevice(path, speed=100))) == 19


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "no column time_s"),
        ("s.A\n1\n", "no column time_s"),
        ("time_s,r.A\n0,1\n", "no sensor columns"),
        ("time_s,s.A B\n0,1\n", "not a channel name"),
        ("time_s,s.A\n0,1\n0.1,x\n", "line 3, column 's.A': 'x' is no number"),
        ("time_s,s.A\n0,1\n0.1\n", "line 3 has 1 values, the header 2"),
        ("time_s,s.A\n0,1\nnan,2\n", "line 3: time_s 'nan' is not a time"),
        ("time_s,s.A\n", "no two frames"),
        ("time_s,s.A\n0,1\n", "no two frames"),
        ("time_s,s.A\n0,1\n0,2\n", "no two frames"),
        ("time_s,s.A\n0,\0\n0,2\n", "replay of"),
    ],
)
def test_bad_tables_are_refused_with_line_and_column(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(BadOption, match=sentence):
        ReplayDevice(table(tmp_path, text))


@pytest.mark.parametrize(
    ("device", "options", "sentence"),
    [
        ("replay", {}, "needs a file"),
        ("replay:", {}, "needs a file"),
        (
            "replay:{table}",
            {"sped": "2"},
            r"no option 'sped'; there are speed=TIMES .*; loop=.*; layout=",
        ),
        ("replay:{table}", {"speed": "fast"}, "not a number"),
        ("replay:{table}", {"speed": "0"}, "positive"),
        ("replay:{table}", {"speed": "nan"}, "positive"),
        ("replay:{table}", {"loop": "maybe"}, "yes or no"),
        ("replay:/nowhere/x.csv", {}, "nowhere"),
        ("replay:/", {}, "replay of /"),
    ],
)
def test_bad_options_are_refused(tmp_path: Path, device: str, options: dict, sentence: str) -> None:
    with pytest.raises(BadOption, match=sentence):
        build_device(device.format(table=table(tmp_path)), options)


def test_table_that_is_not_utf8_is_refused(tmp_path: Path) -> None:
    path = table(tmp_path)
    path.write_bytes(TABLE.encode() + b"0.02,\xff,1,2,,\n" * 2)
    with pytest.raises(BadOption, match="not UTF-8 text; save it as UTF-8"):
        ReplayDevice(path)


def test_bad_log_header_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.glvlog"
    FrameLog.create(path, {"sensors": "A"}).close()
    with pytest.raises(BadOption, match="list of names"):
        ReplayDevice(path)
    path.write_bytes(path.read_bytes()[:12])
    with pytest.raises(BadOption, match="not a frame log"):
        ReplayDevice(path)


def test_a_table_of_simulated_takes_is_replayed_as_simulated(tmp_path):
    marked = "time_s,s.A,c.supply_v,c.simulated\n0.00,1,5,{mark}\n0.01,2,5,{mark}\n"
    simulated = ReplayDevice(table(tmp_path, marked.format(mark="1.0")))
    assert simulated.simulated
    assert simulated.context == ("supply_v",)
    assert not ReplayDevice(table(tmp_path, marked.format(mark="0.0"))).simulated
    assert not ReplayDevice(table(tmp_path)).simulated


def test_a_table_is_replayed_as_it_is_imported(tmp_path: Path) -> None:
    text = (
        '\ufeff\r\ntime_s, take , s.A, s.B,c.simulated\r\n0, one, 1, 2.5, 1\r\n\r\n0.01, one,"3", "4",1\r\n'
    )
    path = table(tmp_path, text)
    (take,) = read_takes(path)
    device = ReplayDevice(path, speed=1000)
    played = play(device)
    assert device.sensors == take.sensors == ("A", "B")
    assert np.array([reading.readings for reading in played]).tolist() == take.readings.tolist()
    assert device.simulated == take.simulated


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("sep=,\n" + TABLE, "remove the lines above"),
        (
            TABLE.replace("10.00,", "s,,raw,raw,deg,V\n10.00,", 1),
            "'s' is no number; remove this line if it",
        ),
        (TABLE.replace("10.01,", "# a cable moved\n10.01,", 1), "line 3 has 1 values, the header 6; remove"),
    ],
)
def test_lines_that_are_no_rows_are_to_be_removed(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(BadOption, match=re.escape(said)):
        play(ReplayDevice(table(tmp_path, text), speed=1000))
