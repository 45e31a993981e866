"""What people say of a take: a stretch is left out, told, and used again; a note is kept."""

from __future__ import annotations

from pathlib import Path

from cli_running import Run


def test_a_stretch_is_left_out_told_and_used_again(run: Run, tables: Path) -> None:
    run("take", "import", tables / "train.csv", "-s", "anna")
    marked = run("take", "leave-out", "poses", "--from", "2", "--to", "4.5")
    assert marked.out == "Take poses: 2.00 to 4.50 s left out.\n"
    assert marked.said == "Existing models are unchanged; train again."
    assert "2.00 to 4.50 s" in run("take", "check", "poses").out
    run("take", "leave-out", "poses", "--from", "6", "--to", "7")
    (row, _) = run("take", "list", "--json").json
    assert row["left_out"] == [[2.0, 4.5], [6.0, 7.0]]
    again = run("take", "leave-out", "poses", "--undo", "--from", "2", "--to", "4.5")
    assert again.out == "Take poses: 6.00 to 7.00 s left out.\n"
    assert run("take", "leave-out", "poses", "--undo").out == "Take poses: nothing left out.\n"


def test_a_note_is_kept_and_told(run: Run, tables: Path) -> None:
    run("take", "import", tables / "train.csv", "-s", "anna")
    assert run("take", "note", "poses", "thumb was cold").out == "Take poses: thumb was cold.\n"
    run("take", "leave-out", "poses", "--from", "2", "--to", "4.5")
    assert "thumb was cold" in run("take", "check", "poses").out
    assert run("take", "note", "poses", "").out == "Take poses: no note.\n"
    assert "note" not in run("take", "check", "poses").out


def test_what_is_wrong_is_told(run: Run, tables: Path) -> None:
    run("take", "import", tables / "train.csv", "-s", "anna")
    assert "--from SECONDS --to SECONDS" in run("take", "leave-out", "poses").said
    assert "--from SECONDS --to SECONDS" in run("take", "leave-out", "poses", "--from", "2", "--undo").said
    assert "the earlier one first" in run("take", "leave-out", "poses", "--from", "5", "--to", "2").said
    assert "nothing to undo" in run("take", "leave-out", "poses", "--undo").said
