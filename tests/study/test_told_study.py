"""What is told of healthy gloves is counted by glove and verb; a glove that nobody tuned on has none."""

from __future__ import annotations

import pytest
from told_study import FIRST, HEAD, Told, main, rows, told


def test_a_glove_counts_once_for_each_verb() -> None:
    twice = (("wearing", "A is off."), ("wearing", "A is off."), ("sensor", "B is dead."))
    found = [Told(1, "still", 15.0, {"doctor": twice}), Told(2, "holds", 30.0, {"doctor": (), "live": ()})]
    first, second = rows(found)
    assert first.startswith("| doctor | 2 | 1 | 1.3 to 98.7 % |")
    assert "wearing 1" in first
    assert second == "| live | 1 | 0 | 0.0 to 97.5 % |  |"
    assert HEAD.splitlines()[0].count("|") == first.count("|")


def test_nothing_is_told_of_a_healthy_glove() -> None:
    found = told(FIRST, "linear")
    assert len(found.said) == 8
    assert {verb: sentences for verb, sentences in found.said.items() if sentences} == {}


def test_the_smoke_prints_a_row_for_each_verb(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--smoke", "--workers", "1"]) == 0
    assert capsys.readouterr().out.count("| 1 | 0 |") == 8
