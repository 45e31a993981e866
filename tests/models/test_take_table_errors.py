"""Broken take tables: every error says where, what was found and what would be right."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_models.errors import BadTakeTable
from glovecal_models.takes.table import read_takes

GOOD = "time_s,take,wearing,s.A,r.R\n0,p,w,1,2\n1,p,w,3,\n"

BROKEN = [
    # content, line, column, words in the message
    ("", None, None, "empty"),
    ("\n\n", None, None, "empty"),
    ("time_s,s.A\n", 1, None, "only a header"),
    ("s.A\n1\n", 1, None, "no column time_s"),
    ("time_s,r.R\n0,1\n", None, None, "no readings"),
    ("time_s,s.A,s.A\n0,1,2\n", 1, "s.A", "twice"),
    ("time_s,s.A,,s.B\n0,1,2,3\n", 1, None, "column 3 has no name"),
    ("time,s.A\n0,1\n", 1, "time", "did you mean time_s"),
    ("time_s,sensor.A\n0,1\n", 1, "sensor.A", "did you mean s.A"),
    ("time_s,R.I_MCP,s.A\n0,1,2\n", 1, "R.I_MCP", "did you mean r.I_MCP"),
    ("time_s,I_MCP\n0,1\n", 1, "I_MCP", "s.I_MCP for raw readings"),
    ("time_s,wearing_,s.A\n0,1,2\n", 1, "wearing_", "did you mean wearing"),
    ("time_s,s.2A\n0,1\n", 1, "s.2A", "not a channel name"),
    ("time_s,x!y,s.A\n0,1,2\n", 1, "x!y", "columns are time_s"),
    ("time_s;s.A\n0;1,5\n", 1, None, "semicolons"),
    ("time_s\ts.A\n0\t1\n", 1, None, "tabs"),
    ('time_s,s.A\n0,"1,5"\n', 2, "s.A", "decimal point"),
    ("time_s,s.A\n0,1,5\n", 2, None, "decimal commas"),
    ("time_s,s.A\n0,1\n1\n", 3, None, "1 cells, but the header has 2"),
    ("time_s,s.A\n0,1\n1,abc\n", 3, "s.A", "'abc' is not a number"),
    ("time_s,s.A\n0,1_000\n", 2, "s.A", "'1_000' is not a number"),
    ("time_s,s.A\n0,\u0661\n", 2, "s.A", "is not a number"),
    ("time_s,s.A\n0,1\n1,\n", 3, "s.A", "the cell is empty"),
    ("time_s,s.A\n0,nan\n", 2, "s.A", "nan is not finite"),
    ("time_s,s.A\n0,1e999\n", 2, "s.A", "1e999 is not finite"),
    ("time_s,s.A,r.R\n0,1,inf\n", 2, "r.R", "inf is not finite"),
    ("time_s,s.A\n,1\n", 2, "time_s", "time in seconds"),
    (
        "time_s,s.A,r.R\n0,1,2\n1,1,12000\n",
        3,
        "r.R",
        "12000 is impossible for an angle in degrees (limit 360",
    ),
    ("time_s,s.A,r.R\n0,1,-360.5\n", 2, "r.R", "write the angle in degrees"),
    ("time_s,s.A\n0,1\n1,1e300\n", 3, "s.A", "1e300 is larger than a live frame can carry (float32"),
    ("time_s,s.A,c.load_n\n0,1,-1e39\n", 2, "c.load_n", "-1e39 is larger than"),
    ("time_s,s.A\n1763800000000000000,1\n", 2, "time_s", "(divide milliseconds by 1e3"),
    ("time_s,s.A\n0,1\n8333,1\n40000000,1\n", 4, "time_s", "1.27 years after the first frame"),
    ("time_s,s.A\n0,1\n1763800000,1\n1763800001,1\n", 3, "time_s", "years after the first frame"),
    ("time_s,s.A\n0,1\n2,1\n1,1\n", 4, "time_s", "1.0 does not come after 2.0"),
    ("time_s,s.A\n0,1\n0,1\n", 3, "time_s", "too few digits"),
    ("time_s,s.A\n0,1\n0,1\n1,1\n2,1\n", 3, "time_s", "batches"),
    ("time_s,s.A\n0,1\n2,1\n2,1\n4,1\n", 4, "time_s", "batches"),
    ("time_s,s.A\n0,1\n\n\n-1,1\n", 5, "time_s", "does not come after"),
    ("time_s,take,s.A\n0,p,1\n1,,1\n", 3, "take", "name of its take"),
    ("time_s,wearing,s.A\n0,w1,1\n1,w2,1\n", 3, "wearing", "inside one wearing"),
    ("time_s,pose,s.A\n0,a\x00b,1\n", 2, "pose", "cannot be printed"),
    ("time_s,pose,s.A\n0," + "x" * 300 + ",1\n", 2, "pose", "300 characters"),
    ("time_s,s.A\n0," + "9" * 200_000 + "\n", 2, None, "field larger"),
    ('time_s,s.A\n0,"1\n1,2\n', 2, None, "quote"),
    ('time_s,s.A\n0,"1,321"\n', 2, "s.A", "(a separator of thousands? write 1321; a decimal comma? write a"),
    ('time_s,s.A\n0,"-12.321.000,5"\n', 2, "s.A", "write -12321000.5;"),
    ('time_s,s.A\n0,"0,321"\n', 2, "s.A", "write a decimal point"),
    ("time_s,s.A\n0,1 321\n", 2, "s.A", "write 1321;"),
    ("sep=,\ntime_s,s.A\n0,1\n", 1, None, "remove this line"),
    ("sep=;\ntime_s;s.A\n0;1\n", 1, None, "remove this line"),
    ("# of Monday\ntime_s,s.A\n0,1\n", 1, None, "a comment; remove this line"),
    ("Glove,right\nRate,60\ntime_s,s.A\n0,1\n", 1, None, "named in line 3; remove the lines above it"),
    ("time_s,s.A\ns,counts\n0,1\n", 2, None, "no number stands here (s, counts): units, or nothing"),
    ("time_s,take,s.A\n[s],,[raw]\n0,p,1\n", 2, None, "remove this line"),
    ("time_s,s.A\n0,1\n# glove off\n1,1\n", 3, None, "a comment; remove this line"),
    ("time_s,s.A\n0,1\ntime_s,s.A\n1,1\n", 3, None, "names of the columns again; remove this line"),
    ("time_s,s.A\n0,1\n,\n", 3, None, "remove this line"),
    ("time_s," + ",".join(f"s.A{i}" for i in range(1000)) + "\n0\n", 1, None, "1001 columns"),
]


@pytest.mark.parametrize(("content", "line", "column", "words"), BROKEN, ids=lambda value: str(value)[:30])
def test_broken_csv_is_refused_with_its_place(tmp_path, content, line, column, words):
    path = tmp_path / "take.csv"
    path.write_bytes(content.encode())
    with pytest.raises(BadTakeTable) as caught:
        read_takes(path)
    error = caught.value
    assert (error.file, error.line, error.column) == ("take.csv", line, column)
    assert words in error.problem
    assert "take.csv" in str(error)
    assert len(str(error)) < 600


def test_a_line_named_for_removal_is_all_there_is_to_remove(tmp_path):
    path = tmp_path / "take.csv"
    lines = [
        "sep=,",
        "# of Monday",
        "time_s,s.A",
        "s,counts",
        "0,1",
        "% cable moved",
        "time_s,s.A",
        "1,2",
        ",",
    ]
    kept = ["time_s,s.A", "0,1", "1,2"]
    for _ in range(len(lines) - len(kept)):
        path.write_text("\n".join(lines) + "\n")
        with pytest.raises(BadTakeTable, match="remove this line") as caught:
            read_takes(path)
        del lines[(caught.value.line or 0) - 1]
    assert lines == kept
    path.write_text("\n".join(lines) + "\n")
    (take,) = read_takes(path)
    assert take.time_s.tolist() == [0.0, 1.0]


@pytest.mark.parametrize(
    ("content", "line", "words"),
    [
        ("time_s,s.A\n".encode("utf-16"), None, "UTF-16"),
        (b"PK\x03\x04 a spreadsheet", None, "spreadsheet"),
        (b"\x1f\x8b\x08 packed", None, "gzip"),
        (b"time_s,pose,s.A\n0,flat,1\n1,f\xe4ust,2\n", 3, "byte 0xe4 is not UTF-8"),
    ],
)
def test_other_encodings_and_file_kinds_are_named(tmp_path, content, line, words):
    path = tmp_path / "take.csv"
    path.write_bytes(content)
    with pytest.raises(BadTakeTable, match=words) as caught:
        read_takes(path)
    assert caught.value.line == line


def test_missing_files_and_folders_are_named(tmp_path):
    for path in (tmp_path / "absent.csv", tmp_path):
        with pytest.raises(BadTakeTable, match="no such file"):
            read_takes(path)


REFERENCES = [
    ("time_s,r.R,s.A\n0,1,2\n", "reference table holds"),
    ("time_s,pose\n0,flat\n", "no column r.<ROTATION>"),
    ("time_s,take,r.R\n0,q,1\n", "take 'q' has a reference, but no frames"),
    ("time_s,r.R\n0,1\n", "no column take"),
]


@pytest.mark.parametrize(("content", "words"), REFERENCES)
def test_a_reference_that_does_not_fit_its_frames_is_refused(tmp_path, content, words):
    frames, reference = tmp_path / "f.csv", tmp_path / "r.csv"
    frames.write_text("time_s,take,s.A\n0,p,1\n0,p2,1\n")
    reference.write_text(content)
    with pytest.raises(BadTakeTable, match=words):
        read_takes(frames, reference)


def test_two_references_or_two_wearings_are_refused(tmp_path):
    frames, reference = tmp_path / "f.csv", tmp_path / "r.csv"
    frames.write_text(GOOD)
    reference.write_text("time_s,r.R\n0,1\n")
    with pytest.raises(BadTakeTable, match="keep one"):
        read_takes(frames, reference)
    with pytest.raises(BadTakeTable, match="wearing 'other' was asked for"):
        read_takes(frames, wearing="other")


def write_parquet(path, columns) -> None:
    import pyarrow as pa
    import pyarrow.parquet

    pyarrow.parquet.write_table(pa.table(columns), path)


@pytest.mark.parametrize(
    ("columns", "column", "words"),
    [
        ({"time_s": [0.0, 1.0], "s.A": [1.0, None]}, "s.A", "row 2: the cell is empty"),
        ({"time_s": [0.0, 1.0], "s.A": [1.0, np.inf]}, "s.A", "row 2: inf is not finite"),
        ({"time_s": [0.0, 1.0], "s.A": [1.0, 1e300]}, "s.A", "row 2: 1e.300 is larger than a live frame"),
        ({"time_s": [0], "s.A": [1], "r.R": [12000]}, "r.R", "row 1: 12000 is impossible for an angle"),
        ({"time_s": [1, 0], "s.A": [1, 2]}, "time_s", "row 2: 0.0 does not come after 1.0"),
        ({"time_s": [0.0], "s.A": ["x"]}, "s.A", "holds string"),
        ({"time_s": [0.0], "s.A": [1], "pose": [1.5]}, "pose", "holds double"),
        ({"time_s": np.empty(0), "s.A": np.empty(0)}, None, "no rows"),
    ],
)
def test_broken_parquet_is_refused_with_its_row(tmp_path, columns, column, words):
    path = tmp_path / "take.parquet"
    write_parquet(path, columns)
    with pytest.raises(BadTakeTable, match=words) as caught:
        read_takes(path)
    assert caught.value.column == column


def test_parquet_integers_and_nulls_are_read(tmp_path):
    path = tmp_path / "take.parquet"
    write_parquet(path, {"time_s": [0, 1], "wearing": [3, 3], "s.A": [7, 8], "r.R": [None, 2]})
    (take,) = read_takes(path)
    np.testing.assert_array_equal(take.readings[:, 0], [7, 8])
    np.testing.assert_array_equal(take.reference[:, 0], [np.nan, 2])
    assert take.wearing == "3"


def test_damaged_parquet_is_refused(tmp_path):
    path = tmp_path / "take.parquet"
    path.write_bytes(b"PAR1 and then nothing of the kind PAR1")
    with pytest.raises(BadTakeTable, match="not a readable Parquet file"):
        read_takes(path)
    path.write_bytes(b"time_s,s.A\n0,1\n")
    with pytest.raises(BadTakeTable, match="does not begin with PAR1"):
        read_takes(path)


@settings(max_examples=300)
@given(
    st.one_of(
        st.binary(max_size=200),
        st.text(st.sampled_from('tse_.srcAR,;"\n\r01-+enaif \x00é'), max_size=120).map(str.encode),
        st.tuples(st.integers(0, len(GOOD) - 1), st.binary(min_size=1, max_size=3)).map(
            lambda edit: GOOD.encode()[: edit[0]] + edit[1] + GOOD.encode()[edit[0] + 1 :]
        ),
    )
)
def test_any_bytes_are_read_or_refused_but_never_crash(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("wild") / "take.csv"
    path.write_bytes(content)
    assert_read_or_refused(path)


def assert_read_or_refused(path) -> None:
    refused, takes = None, []
    try:
        takes = read_takes(path)
    except BadTakeTable as error:
        refused = error
    if refused is not None:
        assert refused.file == path.name
    else:
        assert all(len(take.time_s) for take in takes)


@pytest.fixture(scope="module")
def good_parquet(tmp_path_factory) -> bytes:
    path = tmp_path_factory.mktemp("parquet") / "take.parquet"
    write_parquet(
        path, {"time_s": np.arange(20.0), "pose": ["flat"] * 20, "s.A": np.arange(20), "r.R": np.ones(20)}
    )
    return path.read_bytes()


@settings(max_examples=200)
@given(st.lists(st.tuples(st.integers(4, 10**6), st.integers(0, 255)), min_size=1, max_size=3))
def test_parquet_with_changed_bytes_is_read_or_refused(tmp_path_factory, good_parquet, changes):
    content = bytearray(good_parquet)
    for place, byte in changes:
        content[4 + place % (len(content) - 4)] = byte
    path = tmp_path_factory.mktemp("flipped") / "take.parquet"
    path.write_bytes(content)
    assert_read_or_refused(path)
