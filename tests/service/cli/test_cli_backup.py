"""``glovecal backup``: made, tried, restored elsewhere, and refused where something is there."""

from __future__ import annotations

from pathlib import Path

from cli_running import Run, glovecal


def test_a_backup_is_made_tried_and_restored_into_another_folder(run: Run, tmp_path: Path) -> None:
    assert run("subject", "add", "anna").code == 0
    file, artifacts = tmp_path / "today.backup", tmp_path / "objects"
    made = run("backup", "make", file)
    assert made.code == 0, made.err
    assert "1 subject, 0 takes, 0 models" in made.out
    assert file.stat().st_mode & 0o077 == 0, "for its owner only"
    assert "exists already" in run("backup", "make", file).said
    assert "can be restored" in run("backup", "check", file).out
    assert "is not empty" in run("backup", "restore", file).said
    artifacts.mkdir()
    place = {"GLOVECAL_DATA": str(tmp_path / "other"), "GLOVECAL_ARTIFACTS": artifacts.as_uri()}
    restored = glovecal(place, "backup", "restore", file)
    assert restored.code == 0, restored.err
    assert "anna" in glovecal(place, "subject", "list").out
    file.write_bytes(file.read_bytes()[:-20_000])
    cut = run("backup", "check", file)
    assert cut.code == 1
    assert "today.backup is damaged" in cut.said
