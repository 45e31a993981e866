"""Tables that other programs wrote: what their columns are guessed to be, and that every number arrives."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
from foreign_tables import ROTATIONS, SHAPES, laboratory, logger, semicolons, takes
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import glovecal
from glovecal_models.errors import BadTakeTable
from glovecal_models.takes.column_guess import guess_mapping
from glovecal_models.takes.column_mapping import mapped_table
from glovecal_models.takes.table import read_takes, wearing_of
from glovecal_models.takes.table_preview import preview_table

COUNT, SECONDS = 5, 4.0
"""Takes (of two wearings), and how long each is."""


@pytest.mark.parametrize("write", SHAPES)
def test_every_number_of_a_foreign_table_arrives(write: Callable[..., list[Path]], tmp_path: Path) -> None:
    files = write(tmp_path, COUNT, seconds=SECONDS)
    previews = [preview_table(file) for file in files]
    found = [
        take
        for file, seen in zip(files, previews, strict=True)
        for take in read_takes(file, mapping=seen.mapping)
    ]
    assert [seen.problem for seen in previews] == [None] * len(files)
    wanted = takes(COUNT, seconds=SECONDS)
    assert [take.wearing for take in found] == [wearing for _, wearing, *_ in wanted]
    volts = 3.3 / 4095 if write is laboratory else 1.0
    for take, (_, _, time_s, readings, angles) in zip(found, wanted, strict=True):
        np.testing.assert_allclose(take.time_s - take.time_s[0], time_s, atol=6e-5)
        np.testing.assert_allclose(take.readings, readings * volts, atol=6e-5)
        known = np.isfinite(take.reference).all(axis=1)
        assert known.mean() == (0.5 if write is laboratory else 1.0)
        np.testing.assert_allclose(take.reference[known], angles[known], atol=6e-3)
        if write is not logger:  # whose columns name no joint
            assert take.rotations == take.sensors == ROTATIONS


TIMES = {"time [s]": 1.0, "t_ms": 1e3, "Timestamp (us)": 1e6, "elapsed nanoseconds": 1e9}
NAMES = (
    ("{}_raw", "{}_angle"),
    ("Sensor {}", "Reference {}"),
    ("adc {}", "mocap_{}"),
    ("glove.{}", "vicon.{}"),
)


@given(
    separator=st.sampled_from([",", ";", "\t", "|"]),
    unit=st.sampled_from(sorted(TIMES)),
    names=st.sampled_from(NAMES),
    radians=st.booleans(),
    above=st.lists(st.sampled_from(["# by hand", "Recorded on Monday", "%"]), max_size=2),
    seed=st.integers(0, 5),
)
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_whatever_it_looks_like_it_is_read_as_it_was_written(
    tmp_path: Path,
    separator: str,
    unit: str,
    names: tuple[str, str],
    radians: bool,
    above: list[str],
    seed: int,
) -> None:
    rng = np.random.default_rng(seed)
    time_s = np.arange(200) / 50.0
    angles = 40 + 30 * np.sin(time_s[:, None] * [1.0, 1.7] + rng.uniform(0, 6, 2))
    counts = np.round(500 + 5 * angles + rng.normal(0, 1, angles.shape))
    decimal = "," if separator == ";" else "."
    reading, angle = names
    heads = [unit, *(reading.format(f"Index {each}") for each in ("MCP", "PIP"))]
    heads += [angle.format(f"Index {each}") for each in ("MCP", "PIP")]
    path = tmp_path / "table.csv"
    with path.open("w", newline="", encoding="utf-8") as stream:
        stream.writelines(f"{line}\n" for line in above)
        writer = csv.writer(stream, delimiter=separator)
        writer.writerow(heads)
        for at, row, true in zip(time_s, counts, angles, strict=True):
            written = np.radians(true) if radians else true
            cells = [f"{at * TIMES[unit]:.3f}", *(f"{x:.0f}" for x in row), *(f"{x:.6f}" for x in written)]
            writer.writerow([cell.replace(".", decimal) for cell in cells])
    mapping = guess_mapping(path)
    [take] = read_takes(path, mapping=mapping)
    assert take.sensors == take.rotations == ("I_MCP", "I_PIP")
    np.testing.assert_allclose(take.time_s, time_s, atol=1e-6)
    np.testing.assert_array_equal(take.readings, counts)
    np.testing.assert_allclose(take.reference, angles, atol=1e-4)


WRONG = {
    "picture.png": b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + bytes(200),
    "sheet.xlsx": b"PK\x03\x04" + bytes(100),
    "packed.csv": b"\x1f\x8b\x08" + bytes(100),
    "empty.csv": b"",
    "blank.csv": b"\n\n \n",
    "words.csv": b"this is,a letter\nand not,a table\n",
    "settings.json": b'{"min": 500,\n "max": 500.5}\n',
    "cut.parquet": b"PAR1" + bytes(50),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_file_gets_a_sentence_that_names_it(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(WRONG[name])
    with pytest.raises(BadTakeTable, match=name):
        preview_table(path)


def test_a_table_without_a_time_is_shown_for_correction(tmp_path: Path) -> None:
    path = tmp_path / "still.csv"
    path.write_text("a,b\n1,2\n1,2\n1,2\n")
    assert "no column holds the time of the frames; choose" in str(preview_table(path).problem)


def test_a_take_table_is_read_as_itself(tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    rows = "".join(f"{at / 60:.4f},w1,{500 + at % 90},{at % 90}.5\n" for at in range(120))
    path.write_text(f"time_s,wearing,s.I_PIP,r.I_PIP\n{rows}")
    seen = preview_table(path)
    assert seen.is_take_table
    assert seen.problem is None
    assert (
        seen.sentence == "1 take in 1 wearing of 1 sensor, 2 s in all; 1 rotation measured: a model can "
        "learn from it."
    )
    [own], [mapped] = read_takes(path), read_takes(path, mapping=seen.mapping)
    np.testing.assert_array_equal(own.readings, mapped.readings)
    np.testing.assert_array_equal(own.time_s, mapped.time_s)
    np.testing.assert_array_equal(own.reference, mapped.reference)


def test_a_bad_cell_is_named_as_it_stands_in_the_file(tmp_path: Path) -> None:
    [path] = semicolons(tmp_path, 1, seconds=2.0)
    mapping = guess_mapping(path)
    lines = path.read_text(encoding="cp1252").splitlines(keepends=True)
    lines[10] = lines[10].replace(";t0;w1;", ";t0;w1;x", 1)
    path.write_text("".join(lines), encoding="cp1252")
    with pytest.raises(
        BadTakeTable, match=r"line 11, column 'Thumb IP Sensor \[counts\]': 'x\d+' is not a number"
    ):
        mapped_table(path, mapping)


def test_two_columns_of_one_name_are_refused_before_anything_is_read(tmp_path: Path) -> None:
    [path] = semicolons(tmp_path, 1, seconds=2.0)
    mapping = guess_mapping(path)
    columns = tuple(
        replace(item, name="I_PIP") if item.role == "sensor" else item for item in mapping.columns
    )
    with pytest.raises(BadTakeTable, match=r"would be s\.I_PIP, as 'Thumb IP Sensor"):
        mapped_table(path, replace(mapping, columns=columns))


def test_frames_in_batches_are_spread_and_that_is_told(tmp_path: Path) -> None:
    path = tmp_path / "batches.csv"
    rows = "".join(f"{at // 30};{500 + at % 90};{at % 90},5\n" for at in range(600))
    path.write_text(f"seconds;index raw;index angle\n{rows}")
    seen = preview_table(path)
    assert (seen.problem, seen.equal_times) == (None, "spread")
    assert seen.takes[0].rate_hz == pytest.approx(30.0, rel=0.01)


@pytest.mark.parametrize(
    ("name", "wearing"),
    [
        ("anna-w2-t3", "w2"),
        ("P300-placement1-DF", "placement1"),
        ("session_04 fist", "session_04"),
        ("raw12", None),
        ("window3", None),
        ("w2x", None),
    ],
)
def test_a_files_name_may_say_the_wearing(name: str, wearing: str | None) -> None:
    assert wearing_of(name) == wearing


def test_the_library_reads_them_too(tmp_path: Path) -> None:
    files = logger(tmp_path, COUNT, seconds=SECONDS)
    seen = glovecal.look(files[0])
    assert seen.takes[0].wearing == "w1"
    found = glovecal.read_takes(*files, columns="guess")
    assert [take.wearing for take in found] == [wearing for _, wearing, *_ in takes(COUNT)]
    [again] = glovecal.read_takes(files[0], columns=seen.mapping)
    np.testing.assert_array_equal(again.readings, found[0].readings)


def test_utf_16_and_parquet_are_read_as_the_same_text_is(tmp_path: Path) -> None:
    [path] = laboratory(tmp_path, 2, seconds=3.0)
    text = path.read_text(encoding="utf-8")
    wide = tmp_path / "wide.csv"
    wide.write_text(text, encoding="utf-16")
    header, _units, *rows = csv.reader(text.splitlines())
    columns = pyarrow.table({name: [row[at] for row in rows] for at, name in enumerate(header)})
    pyarrow.parquet.write_table(columns, tmp_path / "same.parquet")
    wanted = read_takes(path, mapping=guess_mapping(path))
    for other in (wide, tmp_path / "same.parquet"):
        found = read_takes(other, mapping=guess_mapping(other))
        assert [take.wearing for take in found] == [take.wearing for take in wanted]
        for one, same in zip(found, wanted, strict=True):
            np.testing.assert_array_equal(one.readings, same.readings)
            np.testing.assert_array_equal(one.time_s, same.time_s)


def test_a_header_is_text_whatever_it_is(tmp_path: Path) -> None:
    path = tmp_path / "odd.csv"
    path.write_text(
        'seconds,"x"" innerHTML=""<b>",angle\n'
        + "".join(f"{i / 50},{7 * i % 70},{i % 90}.5\n" for i in range(90))
    )
    seen = preview_table(path)
    assert seen.problem is None
    assert seen.mapping.columns[1].header == 'x" innerHTML="<b>'
