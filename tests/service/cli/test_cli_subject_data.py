"""``glovecal subject export`` and ``erase``: what is kept of a person, on the command line."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

from cli_running import Run


def test_all_of_a_person_is_written_and_nothing_is_overwritten_unasked(anna: Run, tmp_path: Path) -> None:
    file = tmp_path / "anna.zip"
    said = anna("subject", "export", "anna", "--to", file)
    assert said.code == 0, said.err
    with zipfile.ZipFile(file) as archive:
        assert archive.testzip() is None
        manifest = json.loads(archive.read("manifest.json"))
        assert json.loads(archive.read("subject.json"))["title"] == "Anna Ruiz"
    assert f"Wrote {file}: {len(manifest['files'])} files" in said.out
    assert len([row for row in manifest["files"] if row["name"].endswith("take-1.safetensors")]) == 3
    assert len([row for row in manifest["files"] if row["name"].startswith("originals/")]) == 2
    again = anna("subject", "export", "anna", "--to", file)
    assert again.code == 1
    assert "--overwrite" in again.said
    before = file.read_bytes()
    assert anna("subject", "export", "nobody", "--to", file, "--overwrite").code == 1
    assert file.read_bytes() == before
    assert "must end in .zip" in anna("subject", "export", "anna", "--to", tmp_path / "anna.tar").said


def test_a_subject_is_erased_once_its_name_was_given_again(run: Run, tables: Path, tmp_path: Path) -> None:
    assert run("take", "import", tables / "train.csv", "-s", "anna").code == 0
    wrong = run("subject", "erase", "anna", "--yes", "ben")
    assert wrong.code == 1
    assert "nothing was changed" in wrong.said
    assert len(json.loads(run("take", "list", "--json").out)) == 2
    done = run("subject", "erase", "anna", "--yes", "anna")
    assert done.code == 0, done.err
    assert "takes 2" in done.out
    assert "no longer say who it was" in done.out
    assert "Copies of the data folder that were made elsewhere still hold the subject" in done.out
    assert json.loads(run("take", "list", "--json").out) == []
    assert run("audit", "verify").code == 0
    assert "anna" not in run("audit", "list", "--json").out
    data = tmp_path / "data"
    assert [path for path in data.rglob("*") if path.is_file() and b"anna" in path.read_bytes()] == []
    again = run("subject", "erase", "anna", "--yes", "anna")
    assert again.code == 1
    assert "no subject 'anna'" in again.said
