"""``glovecal subject export``: what is kept of a person, on the command line."""

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
