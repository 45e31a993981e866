"""Import of take tables: kept before it is read, all or nothing, errors that name the cell."""

from __future__ import annotations

import errno
import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glovecal_client.rest import Refused, RestClient
from glovecal_models.errors import BadInput
from glovecal_models.layout import BUILT_IN
from glovecal_models.takes.table import read_takes
from glovecal_service.rest.in_process import in_process_client
from glovecal_service.settings import Settings
from glovecal_service.store.blobs import FolderBlobs
from glovecal_service.store.errors import StorageFull

Write = Callable[..., Path]


@pytest.fixture
def client(client: RestClient) -> RestClient:
    client.post("/subjects", {"name": "anna"})
    return client


def test_the_file_is_kept_and_comes_back_as_it_was(
    client: RestClient, settings: Settings, write_table: Write, tmp_path: Path
) -> None:
    file = write_table()
    answer = client.upload_takes(file, subject="anna", wearing="morning")
    assert [take["name"] for take in answer["takes"]] == ["a", "b"]
    assert answer["imported"] == [take["id"] for take in answer["takes"]]
    assert answer["takes"][0]["wearing"] == "morning"
    sha256 = hashlib.sha256(file.read_bytes()).hexdigest()
    assert answer["original_sha256"] == sha256
    assert (settings.uploads_folder / sha256).read_bytes() == file.read_bytes()
    assert [path.name for path in settings.uploads_folder.iterdir()] == [sha256]
    for file_format in ("csv", "parquet"):
        exported = tmp_path / f"back.{file_format}"
        query = {"format": file_format}
        exported.write_bytes(client.download(f"/takes/{answer['imported'][1]}/export", query))
        [back] = read_takes(exported)
        original = read_takes(file)[1]
        np.testing.assert_array_equal(back.readings, original.readings)
        np.testing.assert_array_equal(back.reference, original.reference)
        assert (back.name, back.wearing) == ("b", "morning")


def test_the_same_file_again_changes_nothing(client: RestClient, write_table: Write) -> None:
    file = write_table()
    first = client.upload_takes(file, subject="anna")
    again = client.upload_takes(file, subject="anna")
    assert again["imported"] == []
    assert again["existing"] == sorted(first["imported"])
    client.delete(f"/takes/{first['imported'][0]}")
    third = client.upload_takes(file, subject="anna")
    assert len(third["imported"]) == 1
    assert third["existing"] == [first["imported"][1]]
    assert len(client.get("/takes")) == 2


def test_a_subject_is_added_where_that_is_asked_for(client: RestClient, write_table: Write) -> None:
    file = write_table("of-ben.csv", seed=3)
    with pytest.raises(Refused, match="there is no subject 'ben'"):
        client.upload_takes(file, subject="Ben")
    first = client.upload_takes(file, subject="Ben", create_subject=True)
    again = client.upload_takes(file, subject="ben", create_subject=True)
    assert (first["subject_created"], again["subject_created"]) == (True, False)
    assert {take["subject"] for take in first["takes"]} == {"ben"}
    assert [take["id"] for take in client.get("/takes", {"subject": "BEN"})] == first["imported"]


def test_a_recording_is_of_one_hand(client: RestClient, write_table: Write) -> None:
    client.post("/subjects", {"name": "ben"})
    file = write_table()
    take = client.upload_takes(file, subject="anna")["imported"][0]
    with pytest.raises(Refused, match=f"already belongs to anna .*{take}.* use subject anna") as refused:
        client.upload_takes(file, subject="ben")
    assert refused.value.status == 409
    assert client.get("/takes", {"subject": "ben"}) == []


@pytest.mark.parametrize(
    ("old", "new", "line", "column", "says"),
    [
        ("0.05,b", "0.05x,b", 127, "time_s", "0.05x"),
        ("0.05,b", "0.03,b", 127, "time_s", "increase"),
        ("0.05,b,", "0.05,b,nan", 127, None, ""),
        ("s.I_PIP", "s.I PIP", 1, "s.I PIP", "channel name"),
        ("s.I_PIP", "s.I_MCP", 1, "s.I_MCP", "twice"),
        ("time_s", "time", 1, None, "time_s"),
    ],
)
def test_errors_name_file_line_and_column(
    shared: RestClient, write_table: Write, old: str, new: str, line: int, column: str | None, says: str
) -> None:
    file = write_table("Mittwoch früh.csv")
    text = file.read_text()
    assert old in text
    before, _, after = text.rpartition(old) if line > 1 else text.partition(old)
    file.write_text(before + new + after)
    with pytest.raises(Refused) as refused:
        shared.upload_takes(file, subject="anna")
    problem = refused.value.problem
    assert problem["status"] == 422
    assert problem["type"] == "urn:glovecal:problem:bad-take-table"
    assert problem["file"] == "Mittwoch früh.csv"
    assert problem["line"] == line
    if column is not None:
        assert problem["column"] == column
    assert says in problem["detail"]
    assert shared.get("/takes") == []


FRAMES = "time_s,take,s.A\n0,x,1\n1,x,2\n0,y,1\n1,y,2\n"


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\n",
        b"time_s,s.A\n",
        b"\xff\xfe\x00",
        b"PK\x03\x04 a spreadsheet",
        b"\x1f\x8b gzip",
        b"PAR1 but not really PAR1",
        b"\x80\x04\x95pickle",
        b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'shape': (1099511627776,)}",
        b"time_s,s.A\n0,1e400\n",
        b"time_s,s.A\n0,NaN\n",
        b"time_s,s.A\nNaN,1\n",
        b"time_s,s.A\n0,1\n0,2\n",
        b'time_s,s.A\n0,"1\n',
        b"time_s,s.A\n0,1,2\n",
        b"time_s,s.A\x00\n0,1\n",
        b"time_s," + b",".join(b"s.S%d" % n for n in range(1100)) + b"\n",
        b"time_s,s.A,r.A\n0,1,inf\n",
        b"time_s,take,s.A\n0,,1\n",
        b"time_s,take,s.A\n0," + b"x" * 300 + b",1\n",
        FRAMES.encode(),  # two takes with exactly the same frames
    ],
)
def test_what_is_no_take_table_leaves_no_take(shared: RestClient, tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "bad.csv"
    file.write_bytes(content)
    with pytest.raises(Refused) as refused:
        shared.upload_takes(file, subject="anna")
    assert refused.value.status in (409, 422), refused.value.problem
    assert shared.get("/takes") == []


def test_a_parquet_bomb_is_refused_by_its_cells(shared: RestClient, tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    column = pa.DictionaryArray.from_arrays(pa.array(np.zeros(13_000_000, np.int32)), pa.array([1.0]))
    file = tmp_path / "bomb.parquet"
    pq.write_table(pa.table({"time_s": column, "s.A": column, "s.B": column, "s.C": column}), file)
    assert file.stat().st_size < 1_000_000
    with pytest.raises(Refused, match="cells") as refused:
        shared.upload_takes(file, subject="anna")
    assert refused.value.status == 422


def test_half_a_file_is_taken_back_when_the_disk_fills(
    client: RestClient, write_table: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, calls = FolderBlobs.write, []

    def fills_up(self: FolderBlobs, name: str, content: bytes) -> None:
        calls.append(name)
        if len(calls) == 3:
            raise StorageFull("no room left; nothing was changed: free some disk space")
        write(self, name, content)

    monkeypatch.setattr(FolderBlobs, "write", fills_up)
    file = write_table(takes=("a", "b", "c"))
    with pytest.raises(Refused, match="no room") as refused:
        client.upload_takes(file, subject="anna")
    assert refused.value.status == 507
    assert client.get("/takes") == []
    monkeypatch.undo()
    assert len(client.upload_takes(file, subject="anna")["imported"]) == 3


def test_a_full_disk_while_uploading(
    client: RestClient, settings: Settings, write_table: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_space(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    file = write_table()
    monkeypatch.setattr("os.fsync", no_space)
    with pytest.raises(Refused) as refused:
        client.upload_takes(file, subject="anna")
    assert refused.value.status == 507
    monkeypatch.undo()
    assert list(settings.uploads_folder.iterdir()) == []
    assert client.upload_takes(file, subject="anna")["imported"]


def test_layouts(client: RestClient, write_table: Write, tmp_path: Path) -> None:
    file = write_table()
    with pytest.raises(Refused, match="needs; its sensors are I_MCP, I_PIP"):
        client.upload_takes(file, subject="anna", layout="cyberglove18")
    with pytest.raises(Refused, match="no layout") as refused:
        client.upload_takes(file, subject="anna", layout="unknown")
    assert refused.value.status == 404
    layout = tmp_path / "finger.toml"
    layout.write_text(
        'name = "finger"\nsensors = ["I_MCP", "I_PIP"]\n[rotations]\nI_MCP = ["I_MCP", "I_PIP"]\n'
    )
    assert client.add_layout(layout) == "finger"
    answer = client.upload_takes(file, subject="anna", layout="finger")
    assert answer["layout"] == "finger"
    made = client.upload_takes(write_table("other.csv", seed=3), subject="anna")["layout"]
    assert client.upload_takes(write_table("third.csv", seed=4), subject="anna")["layout"] == made
    unmeasured = write_table("fourth.csv", seed=5, reference=False)
    assert client.upload_takes(unmeasured, subject="anna")["layout"] == made
    names = [item["name"] for item in client.get("/gloves")["layouts"]]
    assert names == [*BUILT_IN, made, "finger"]


def test_what_a_killed_process_left_is_swept_later(settings: Settings, write_table: Write) -> None:
    settings.uploads_folder.mkdir(parents=True)
    old, young = settings.uploads_folder / "0123.partial", settings.uploads_folder / "4567.partial"
    for stray in (old, young):
        stray.write_bytes(b"half")
    os.utime(old, (0, 0))
    with in_process_client(settings) as client:
        assert [path.name for path in settings.uploads_folder.iterdir()] == [young.name]
        client.post("/subjects", {"name": "anna"})
        assert client.upload_takes(write_table(), subject="anna")["imported"]


def test_a_kept_file_that_was_damaged_is_healed(
    client: RestClient, settings: Settings, write_table: Write
) -> None:
    file = write_table()
    sha256 = client.upload_takes(file, subject="anna")["original_sha256"]
    kept = settings.uploads_folder / sha256
    kept.write_bytes(b"x" * kept.stat().st_size)
    client.upload_takes(file, subject="anna")
    assert kept.read_bytes() == file.read_bytes()


def test_import_for_nobody(shared: RestClient, write_table: Write) -> None:
    with pytest.raises(Refused, match="no subject") as refused:
        shared.upload_takes(write_table(), subject="nobody")
    assert refused.value.status == 404


def test_refusals_are_what_the_model_says(shared: RestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any, **__: Any) -> None:
        raise BadInput("the reason \ud800 with a lone surrogate")

    monkeypatch.setattr("glovecal_service.store.subjects.Subjects.page", refuse)
    with pytest.raises(Refused, match="the reason") as refused:
        shared.get("/subjects")
    assert refused.value.status == 422


def finger(file: Path, *, angle: str = "{deg}", reading: str = "{count}", seconds: float = 1 / 60) -> Path:
    """A table of one finger that bends by 80 degrees; the last row's cells are given as they are."""
    rows = ["time_s,s.I_PIP,r.I_PIP"]
    for frame in range(300):
        deg = 40 - 40 * np.cos(frame / 30)
        rows.append(
            f"{frame * seconds!r},{60 + 1.2 * deg:.0f},{np.radians(deg) if angle == 'rad' else deg:.5f}"
        )
    last = angle.format(deg="10") if angle != "rad" else "1.0"
    rows.append(f"{300 * seconds!r},{reading.format(count=70)},{last}")
    file.write_text("\n".join(rows) + "\n")
    return file


def test_units_that_look_wrong_are_told_at_once(client: RestClient, tmp_path: Path) -> None:
    answer = client.upload_takes(finger(tmp_path / "right.csv"), subject="anna")
    assert answer["warnings"] == []
    answer = client.upload_takes(finger(tmp_path / "rad.csv", angle="rad", reading="71"), subject="anna")
    assert len(answer["imported"]) == 1
    [sentence] = answer["warnings"]
    assert "look like radians" in sentence
    for factor, unit in ((1e3, "milliseconds (60 Hz), divide by 1e3"), (1e6, "microseconds (60 Hz)")):
        file = finger(tmp_path / f"times-{factor:g}.csv", seconds=factor / 60)
        [sentence] = client.upload_takes(file, subject="anna")["warnings"]
        assert f"time_s is wanted in seconds; if it is in {unit}" in sentence


@pytest.mark.parametrize(
    ("given", "column", "value", "says"),
    [
        ({"angle": "12000"}, "r.I_PIP", "12000", "write the angle in degrees"),
        ({"reading": "1e300"}, "s.I_PIP", "1e300", "float32"),
        ({"seconds": 1e9 / 60}, "time_s", "5000000000.0", "nanoseconds (60 Hz), divide by 1e9"),
    ],
)
def test_what_is_impossible_is_refused_with_its_place(
    shared: RestClient, tmp_path: Path, given: dict[str, Any], column: str, value: str, says: str
) -> None:
    with pytest.raises(Refused, match=r"finger\.csv, line 302") as refused:
        shared.upload_takes(finger(tmp_path / "finger.csv", **given), subject="anna")
    problem = refused.value.problem
    assert (problem["status"], problem["line"], problem["column"]) == (422, 302, column)
    assert problem["value"] == value
    assert says in problem["detail"]
    assert shared.get("/takes") == []
