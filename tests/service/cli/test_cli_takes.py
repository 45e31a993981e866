"""``take``, ``subject`` and ``glove``: what goes in comes out, and what is wrong is told."""

from __future__ import annotations

import json
import os
import sqlite3
import stat
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from cli_running import Run

from glovecal_models.takes.table import read_takes, reference_beside
from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes


def same(one: Take, other: Take) -> bool:
    arrays = ("time_s", "readings", "reference_time_s", "reference")
    return (one.sensors, one.rotations, one.wearing, one.poses, one.simulated) == (
        other.sensors, other.rotations, other.wearing, other.poses, other.simulated,
    ) and all(np.array_equal(getattr(one, a), getattr(other, a), equal_nan=True) for a in arrays)  # fmt: skip


def test_a_subject_comes_and_goes(run):
    assert "glovecal subject add" in run("subject", "list").out
    assert run("subject", "add", "anna", "--title", "Anna [bold] Ruiz").out == "Added subject anna.\n"
    (row,) = run("subject", "list", "--json").json
    assert (row["name"], row["title"]) == ("anna", "Anna [bold] Ruiz")
    assert run("subject", "show", "anna", "--json").json == row
    assert "Anna [bold] Ruiz" in run("subject", "show", "anna").out
    assert run("subject", "remove", "anna").code == 0
    assert run("subject", "list", "--json").json == []


def test_a_subject_in_capitals_is_the_one_in_lower_case(run, tables):
    added = run("subject", "add", "Anna")
    assert (added.out, added.said) == ("Added subject anna.\n", "Subject Anna is stored as anna.")
    imported = run("take", "import", tables / "other.parquet", "-s", "ANNA", "--json")
    assert imported.json[0]["subject"] == "anna"
    assert imported.said == "Subject ANNA is stored as anna."
    assert len(run("take", "list", "--subject", "Anna", "--json").json) == 1
    assert run("glove", "wear", "right", "Anna").out == "right is worn by anna.\n"
    assert run("subject", "show", "ANNA", "--json").json["name"] == "anna"


def test_an_import_adds_the_subject_and_a_mistyped_one_can_be_undone(run, tables):
    first = run("take", "import", tables / "other.parquet", "-s", "anna")
    assert first.code == 0
    assert first.said == "Added subject anna. To undo: glovecal subject remove anna --takes"
    wrong = run("take", "import", tables / "train.csv", "-s", "ana")
    assert wrong.said == "Added subject ana. Similar: anna. To undo: glovecal subject remove ana --takes"
    right = run("take", "import", tables / "train.csv", "-s", "anna")
    assert right.code == 1
    assert "this file already belongs to ana" in right.said
    assert "use subject ana, or remove its takes there first" in right.said
    assert run("subject", "remove", "ana").code == 1
    removed = run("subject", "remove", "ana", "--takes").out.splitlines()
    assert [line.split()[:3] for line in removed[:2]] == [
        ["Removed", "take", "poses"],
        ["Removed", "take", "cross"],
    ]
    assert removed[2:] == ["Removed subject ana."]
    again = run("take", "import", tables / "train.csv", "-s", "anna")
    assert (again.code, again.err) == (0, "")
    assert len(run("take", "list", "-s", "anna", "--json").json) == 3


def test_an_import_that_fails_adds_no_subject(run, tmp_path):
    (tmp_path / "bad.csv").write_text("time_s,s.I_MCP\n0,x\n")
    answer = run("take", "import", tmp_path / "bad.csv", "-s", "anna")
    assert answer.code == 1
    assert "Added" not in answer.err
    assert run("subject", "list", "--json").json == []


def test_a_frames_file_finds_its_reference(anna):
    rows = {row["name"]: row for row in anna("take", "list", "--json").json}
    assert list(rows) == ["poses", "cross", "second"]
    assert rows["second"]["reference_rows"] == rows["second"]["frames"]
    assert rows["poses"]["original_sha256"] == rows["cross"]["original_sha256"]
    lines = anna("take", "list").out.splitlines()
    assert [line.split()[1] for line in lines[1:]] == ["poses", "cross", "second"]
    assert not any(line != line.rstrip() for line in lines)


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_take_with_two_clocks_comes_back_from_two_files(anna, tables, tmp_path, ending):
    exported = anna("take", "export", "second", tmp_path / f"x.{ending}")
    assert exported.code == 0, exported.err
    frames, reference = tmp_path / f"x.frames.{ending}", tmp_path / f"x.reference.{ending}"
    assert sorted(tmp_path.iterdir()) == [frames, reference]
    assert exported.out == f"Wrote {frames}.\nWrote {reference}.\n"
    (before,) = read_takes(tables / "test.frames.csv", tables / "test.reference.csv")
    (after,) = read_takes(frames, reference)
    assert same(before, after)


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_take_with_one_clock_comes_back_from_one_file(anna, tables, tmp_path, ending):
    file = tmp_path / f"y.{ending}"
    assert anna("take", "export", "cross", file).code == 0
    assert list(tmp_path.iterdir()) == [file]
    before = {take.name: take for take in read_takes(tables / "train.csv")}["cross"]
    assert same(before, read_takes(file)[0])


def test_a_corrected_file_replaces_what_it_corrects(run, tmp_path):
    file = tmp_path / "walk.csv"
    frames = "".join(f"{i / 10},walk,{i},{{}}\n" for i in range(5))
    table = "time_s,take,s.A,r.R\n" + frames
    file.write_text(table.format(*range(5)))
    (first,) = run("take", "import", file, "-s", "anna", "--json").json
    file.write_text(table.format(10, 11, 12, 13, 14).replace(",walk,", ",stairs,"))
    refused = run("take", "import", file, "-s", "anna")
    assert refused.code == 1
    assert f"take walk ({first['id']})" in refused.said
    assert "--replace" in refused.said
    replaced = run("take", "import", file, "-s", "anna", "--replace", "--json")
    assert f"replaced the reference and names of {first['id']}" in replaced.said
    (row,) = run("take", "list", "--json").json
    assert (row["id"], row["name"]) == (first["id"], "stairs")
    assert run("take", "export", "stairs", tmp_path / "out.csv").code == 0
    assert read_takes(tmp_path / "out.csv")[0].reference.T.tolist() == [[10, 11, 12, 13, 14]]
    assert "were here already" in run("take", "import", file, "-s", "anna").said


@pytest.mark.parametrize("endings", ["csv csv", "csv parquet", "parquet csv", "CSV csv"])
def test_a_reference_beside_its_frames_is_found_by_every_verb(run, tables, tmp_path, endings):
    of_frames, of_reference = endings.split()
    (take,) = read_takes(tables / "test.frames.csv", tables / "test.reference.csv")
    write_takes([take], tmp_path / f"a.{of_frames.lower()}")
    write_takes([take], tmp_path / f"b.{of_reference}")
    frames = (tmp_path / f"a.frames.{of_frames.lower()}").rename(tmp_path / f"x.frames.{of_frames}")
    reference = (tmp_path / f"b.reference.{of_reference}").rename(tmp_path / f"x.reference.{of_reference}")
    assert reference_beside(frames) == reference
    (row,) = run("take", "import", frames, reference, "-s", "anna", "--json").json
    assert row["reference_rows"] == len(take.reference_time_s)


def test_an_export_replaces_nothing_unasked(anna, tmp_path):
    (tmp_path / "x.reference.csv").write_text("mine")
    refused = anna("take", "export", "second", tmp_path / "x.frames.csv")
    assert (refused.code, refused.out) == (1, "")
    assert "x.reference.csv exists already" in refused.said
    assert [file.name for file in tmp_path.iterdir()] == ["x.reference.csv"]
    assert anna("take", "export", "second", tmp_path / "x.frames.csv", "--overwrite").code == 0
    assert (tmp_path / "x.reference.csv").read_text().startswith("time_s")
    assert "no folder" in anna("take", "export", "cross", tmp_path / "none" / "x.csv").said
    assert "is a folder" in anna("take", "export", "cross", _folder(tmp_path / "folder.csv")).said
    wrong = anna("take", "export", "cross", tmp_path / "x.xlsx")
    assert wrong.code == 2
    assert ".csv or .parquet" in wrong.said


def _folder(path: Path) -> Path:
    path.mkdir()
    return path


def test_the_good_files_are_imported_beside_a_bad_one(run, tables, tmp_path):
    run("subject", "add", "ben")
    bad, empty = tmp_path / "bad.csv", tmp_path / "empty.csv"
    lines = (tables / "train.csv").read_text().splitlines()[:4]
    bad.write_text("\n".join([*lines[:3], lines[3].replace(lines[3].split(",")[4], "nonsense", 1)]))
    empty.touch()
    files = (tables / "train.csv", bad, tables / "other.parquet", empty)
    found = run("take", "import", *files, "-s", "ben", "--json")
    assert found.code == 1
    assert [row["name"] for row in json.loads(found.out)] == ["poses", "cross", "thumb"]
    assert f"{bad}: not imported: bad.csv, line 4" in found.said
    assert "nonsense" in found.said
    assert f"{empty}: not imported" in found.said
    again = run("take", "import", tables / "train.csv", "-s", "ben")
    assert again.code == 0
    assert "were here already" in again.err
    assert len(run("take", "list", "--json").json) == 3
    only = run("take", "import", bad, "-s", "ben")
    assert (only.code, only.out) == (1, "")


def test_a_reference_given_by_name(run, tables, tmp_path):
    run("subject", "add", "ben")
    frames, measured = tmp_path / "a.csv", tmp_path / "b.csv"
    frames.write_bytes((tables / "test.frames.csv").read_bytes())
    measured.write_bytes((tables / "test.reference.csv").read_bytes())
    options = ("--reference", measured, "-s", "ben", "--layout", "cyberglove18")
    contradicted = run("take", "import", frames, *options, "--wearing", "monday")
    assert contradicted.code == 1
    assert "the file says 'wearing-1', but wearing 'monday'" in contradicted.said
    (row,) = run("take", "import", frames, *options, "--json").json
    assert row["reference_rows"] == row["frames"]
    two = run("take", "import", frames, measured, *options)
    assert two.code == 2
    assert "one frames file" in two.said


def test_check_tells_what_a_take_is_worth(anna):
    found = anna("take", "check", "second", "--json").json
    assert found["take"]["name"] == "second"
    assert found["rate_hz"] == pytest.approx(20)
    assert (found["gaps"], found["sentences"]) == (0, [])
    assert found["frames_with_reference"] > 0.99
    assert len(found["sensors"]) == 18
    assert len(found["rotations"]) == 22
    read = anna("take", "check", found["take"]["id"][:4])
    assert "20.00" in read.out
    assert "PALM_ARCH" in read.out


def test_a_reference_on_the_wrong_clock_is_told(run, tables, tmp_path):
    run("subject", "add", "ben")
    frames = tmp_path / "frames.csv"
    frames.write_bytes((tables / "test.frames.csv").read_bytes())
    (row,) = run("take", "import", frames, "-s", "ben", "-l", "cyberglove18", "--json").json
    assert row["reference_rows"] == 0
    assert "nothing to train on" in run("take", "check", row["id"]).out
    lines = (tables / "test.reference.csv").read_text().splitlines()
    later = [lines[0], *(f"{float(line.split(',')[0]) + 5e5},{line.partition(',')[2]}" for line in lines[1:])]
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("\n".join(later))
    attached = run("take", "reference", row["name"], wrong)
    assert "; 0 % of its frames" in attached.out
    assert "clocks different" in attached.err
    attached = run("take", "reference", row["name"], tables / "test.reference.csv")
    assert "; 100 % of its frames" in attached.out
    assert attached.err == ""
    assert run("take", "reference", row["name"], wrong, "--clock", "sun").code == 2
    assert run("take", "remove", row["name"]).out == f"Removed take {row['name']} ({row['id']}).\n"
    assert run("take", "list", "--json").json == []


def test_a_take_is_found_by_what_names_it(anna):
    (first, *_) = anna("take", "list", "--json").json
    for name in (first["id"], first["id"][:5], first["name"]):
        assert anna("take", "check", name, "--json").json["take"]["id"] == first["id"]
    for name in ("", "pose", "zz", "%2e%2e", "../x", "\N{SNOWMAN}"):
        refused = anna("take", "check", name)
        assert (refused.code, refused.out) == (1, "")
        assert f"there is no take {name!r}; " in refused.said
        assert "here are poses, cross, second. List them: glovecal take list" in refused.said


def test_a_name_that_two_takes_have_is_asked_about(run, tables, tmp_path):
    for subject in ("anna", "ben"):
        run("subject", "add", subject)
    changed = tmp_path / "train.csv"
    lines = (tables / "train.csv").read_text().splitlines()
    changed.write_text("\n".join(lines[:-1]))
    assert run("take", "import", tables / "train.csv", "-s", "anna").code == 0
    assert run("take", "import", changed, "-s", "ben").code == 0
    asked = run("take", "check", "cross")
    assert asked.code == 1
    assert "2 takes are called 'cross'" in asked.said
    assert "of anna" in asked.said
    assert "of ben" in asked.said


def test_a_layout_of_ones_own(run, tmp_path):
    shown = run("glove", "show", "lucidglove").json
    assert shown == run("glove", "show", "lucidglove", "--json").json["document"]
    mine = tmp_path / "mine.json"
    mine.write_text(json.dumps({**shown, "name": "mine"}))
    assert run("glove", "add", mine).out == "Added layout mine: 5 sensors, 14 rotations.\n"
    half = tmp_path / "half.toml"
    half.write_text('name = "half"\nsensors = ["A", "B"]\n[rotations]\nR = ["A"]\n')
    assert run("glove", "add", half).out == "Added layout half: 2 sensors, 1 rotations.\n"
    names = [item["name"] for item in run("glove", "list", "--json").json["layouts"]]
    assert {"half", "mine", "cyberglove18"} <= set(names)
    assert "half" in run("glove", "list").out
    for content, said in (
        ('name = "half"\nsensors = ["A"]\n[rotations]\nR = ["C"]\n', "'C'"),
        ('name = "../x"\nsensors = ["A"]\n', "'../x' is not allowed"),
        ("sensors = [", "TOML"),
        ('sensors = ["A"]\nwhat = 1\n', "what"),
    ):
        half.write_text(content)
        refused = run("glove", "add", half)
        assert (refused.code, refused.out) == (1, "")
        assert f"{half.name}: " in refused.said
        assert said in refused.said


def test_who_wears_a_glove(run):
    run("subject", "add", "anna")
    assert run("glove", "wear", "right", "anna", "--wearing", "monday").out == "right is worn by anna.\n"
    (seen,) = run("glove", "list", "--json").json["seen"]
    assert (seen["subject"], seen["wearing"]) == ("anna", "monday")
    assert run("glove", "wear", "right", "--nobody").out == "right is worn by nobody.\n"
    assert "no subject 'ben'" in run("glove", "wear", "right", "ben").said
    assert run("glove", "wear", "right").code == 2
    assert run("glove", "wear", "right", "anna", "--nobody").code == 2


def test_how_long_a_gloves_poses_wait(run):
    assert run("glove", "delay", "right", "100").out == "Poses of right come 100 ms late.\n"
    (seen,) = run("glove", "list", "--json").json["seen"]
    assert seen["delay_ms"] == 100
    assert "delay (ms)" in run("glove", "list").out
    assert run("glove", "delay", "right", "0").out == "right is live.\n"
    assert run("glove", "delay", "right", "501").code == 2
    assert run("glove", "remove", "right").code == 0


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_a_file_written_has_the_rights_of_any_other(anna, tmp_path):
    other = tmp_path / "other"
    other.touch()
    assert anna("take", "export", "cross", tmp_path / "x.csv").code == 0
    assert stat.S_IMODE((tmp_path / "x.csv").stat().st_mode) == stat.S_IMODE(other.stat().st_mode)


def test_a_damaged_row_is_named_after_the_sound_ones(run: Run, tmp_path: Path) -> None:
    files = []
    for number in range(2):
        readings = np.arange(30.0 + number)[:, None]
        take = Take(f"t{number}", "w", ("A",), np.arange(30 + number) / 60, readings, ("A",),
                    np.arange(30 + number) / 60, readings)  # fmt: skip
        files += write_takes([take], tmp_path / f"t{number}.csv")
    run("subject", "add", "anna")
    assert run("take", "import", *files, "-s", "anna").code == 0
    with closing(sqlite3.connect(tmp_path / "data" / "glovecal.sqlite3")) as connection:
        connection.execute("UPDATE takes SET frames = 31 WHERE name = 't0'")
        connection.commit()
    listed = run("take", "list")
    assert listed.code == 0
    assert "t1" in listed.out
    assert "t0" not in listed.out
    assert "of table takes was changed after it was written; restore a backup" in listed.said


def test_units_that_look_wrong_are_told_once_for_all_files_by_every_import(run: Run, tmp_path: Path) -> None:
    files = []
    for number in range(3):
        degrees = 40 - (40 + number) * np.cos(np.arange(300) / 30)
        time_s = np.arange(300) / 60
        readings = np.round(60 + 1.2 * degrees)[:, None]
        radians = np.radians(degrees)[:, None]
        take = Take(f"t{number}", "w", ("I_PIP",), time_s, readings, ("I_PIP",), time_s, radians)
        files += write_takes([take], tmp_path / f"t{number}.csv")
    run("subject", "add", "anna")
    imported = run("take", "import", *files, "-s", "anna")
    assert imported.code == 0, imported.err
    assert imported.err.count("look like radians") == 1
    assert "multiply by 57.2958. The same in 2 more files.\n" in imported.err
    improved = run("improve", "--takes", *files, "--method", "linear", "--max-steps", "0")
    assert improved.code == 0, improved.err
    assert f"{files[0]}: Take 't0': no reference angle spans more than" in improved.err
    assert "The same in 2 more files.\n" in improved.err


def _exported(run: Run, folder: Path, take: str) -> Path:
    assert run("take", "export", take, folder / "take.csv").code == 0
    return folder / "take.csv"


def test_a_take_becomes_a_motion_file(anna: Run, tmp_path: Path) -> None:
    take = anna("take", "list", "--json").json[0]["name"]
    file = tmp_path / "hand.trc"
    assert "nobody said which hand" in anna("take", "motion", file, take, "--content", "raw").said
    assert anna("subject", "measure", "anna", "--hand", "right").code == 0
    made = anna("take", "motion", file, take, "--content", "raw")
    assert made.code == 0, made.err
    assert made.out.strip() == f"Wrote {file}."
    assert file.read_text().startswith(f"PathFileType\t4\t(X/Y/Z)\t{file.name} (simulated)\n")
    assert "--overwrite" in anna("take", "motion", file, take).said
    table = tmp_path / "readings.csv"
    assert anna("take", "motion", table, take, "--content", "raw").code == 0
    (again,) = read_takes(table)
    (exported,) = (one for one in read_takes(_exported(anna, tmp_path, take)))
    assert again.simulated
    assert np.array_equal(again.readings, exported.readings)
    assert "no model of anna" in anna("take", "motion", tmp_path / "a.trc", take).said
    assert "must end in .trc" in anna("take", "motion", tmp_path / "a.stl", take).said
