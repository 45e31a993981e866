"""``do.py paper``: parts in worker processes, figures kept, one page that needs nothing else."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import cast

import pytest
from kept_results import KeptResults, programs_hash
from paper import main
from paper_job import PaperJob, Rows
from paper_page.section import Demand
from paper_parts import PARTS
from paper_workers import work_off

PART = ("--part", "table-1", "--quick", "--workers", "1")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """With table 1 computed."""
    folder = tmp_path_factory.mktemp("paper")
    assert main([*PART, "--folder", str(folder)]) == 0
    return folder


def test_the_page_has_both_figures_and_needs_nothing_else(folder) -> None:
    page = (folder / "paper-quick.html").read_text(encoding="utf-8")
    for told in ("<td>45.7 %</td>", "<b>simulated</b>", "<b>quick</b>", "seed 1", "<svg", "IM_ABD"):
        assert told in page
    assert not re.search(r"(src|href)=\"(?!#)", page)
    assert "<script" not in page
    for name in PARTS:
        assert (f"do.py paper --part {name}</code>" in page) == (name != "table-1")


def test_a_part_is_not_computed_twice_unless_asked(folder, capsys) -> None:
    kept = folder / "table-1-seed-1-quick.json"
    before = kept.stat().st_mtime_ns
    assert main([*PART, "--folder", str(folder)]) == 0
    assert "1 of 1 are known" in capsys.readouterr().out
    assert kept.stat().st_mtime_ns == before
    assert main([*PART, "--folder", str(folder), "--again"]) == 0
    assert "table-1: took" in capsys.readouterr().err
    assert kept.stat().st_mtime_ns > before


def test_results_of_other_programs_are_not_shown(folder) -> None:
    kept = KeptResults(folder, programs_hash())
    result = kept.get("table-1", 1, True)
    assert result is not None
    assert len(result.rows["table-1"]) == 25
    assert result.computer
    assert KeptResults(folder, "of yesterday").get("table-1", 1, True) is None
    assert kept.get("table-1", 2, True) is None
    document = json.loads((folder / "table-1-seed-1-quick.json").read_text())
    assert document["programs"] == programs_hash()


def test_jobs_that_fail_are_told_and_keep_nothing(capsys) -> None:
    finished = []
    jobs = [PaperJob(name, cast(Rows, math.sqrt)) for name in ("wrong", "too")]
    assert work_off(jobs, 1, True, 1, finished.append) == ["wrong", "too"]
    assert not finished
    assert "wrong: failed: TypeError" in capsys.readouterr().err


def test_what_must_be_reached_is_marked() -> None:
    missed = Demand("Fist, LMC-GPR", 1.62, 1.5, "degrees")
    assert not missed.is_reached
    assert missed.mark() == "MISSED: at most 1.5"
    assert missed.sentence() == "Fist, LMC-GPR: 1.62 degrees, must be at most 1.5."
    assert Demand("Flat, LMC-GPR", 0.9, 0.9, "degrees").mark() == "reached: at most 0.9"


def test_an_unknown_part_is_refused(capsys) -> None:
    with pytest.raises(SystemExit):
        main(["--part", "table-9"])
    assert "there is no part 'table-9'; there are table-1" in capsys.readouterr().err
