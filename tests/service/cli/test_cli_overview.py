"""``glovecal`` alone tells what there is and what comes next; the command it names goes on."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

from foreign_tables import semicolons


def following(out: str) -> str:
    """The first command that it names."""
    return next(line.strip() for line in out.splitlines() if line.startswith("  glovecal "))


def test_where_nothing_is_nothing_is_made(run: Any, tmp_path: Path) -> None:
    told = run()
    assert told.code == 0, told.err
    assert "Nothing is in" in told.out
    assert "glovecal demo" in told.out
    assert not (tmp_path / "data").exists()


def test_from_a_recording_to_a_diagnosis_by_what_it_says(run: Any, tmp_path: Path) -> None:
    [path] = semicolons(tmp_path, 6, seconds=8.0)
    assert run("take", "import", path, "-s", "dora", "--columns", "guess").code == 0
    told = run()
    assert "1 subject, 6 takes, 0 models, 0 active." in told.out.replace("\n", " ")
    assert following(told.out) == "glovecal train --subject dora"
    trained = run(*shlex.split(following(told.out))[1:], "--method", "linear", "--no-activate")
    assert trained.code == 0, trained.err
    told = run()
    model = following(told.out).split()[-1]
    assert following(told.out) == f"glovecal diagnose {model}"
    assert f"glovecal model activate {model}" in told.out
    assert run("diagnose", model).code == 0
    assert "was found" in run().out
