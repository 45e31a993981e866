"""The demos' table: what is asked for, what its lines say, and where it stands."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from demo_table import BEGIN, END, HEADS, answers, main, summary, table
from finished_gloves import FinishedGloves, software_hash

PAGE = f"# As measured\n\n{BEGIN}\nlast year\n{END}\n\nAfter it.\n"


def answer(demo: str, truth: str, named: list[str], *wrong: str) -> dict[str, Any]:
    return {
        "demo": demo,
        "hidden": {"truth": truth, "form": "play", "confidence_set": named, "right": truth in named},
        "error_fall_deg": {"raw": 5.0, "lmc_gpr": 3.456, "with_effect": 0.8},
        "noise_floor_deg": 0.57,
        "afterwards": "something is left",
        "wrong": list(wrong),
    }


def test_a_line_for_each_demo():
    found = [answer("3", "lag", ["lag", "creep"]), answer("4", "lag", ["creep"], "creep was named")]
    head, _, right, wrong = table(found).splitlines()
    assert all(name in head for name in HEADS)
    assert right == "| 3 | lag (play) | lag, creep | something is left | 3.46 to 0.80 | 0.57 |  |"
    assert wrong.endswith("| creep was named |")
    assert (
        "2 demos; first name right (or rightly none) in 1; in 1 nothing was told that is not so"
        in summary(found)
    )


def test_finished_demos_are_put_into_their_page(tmp_path: Path):
    kept = FinishedGloves(tmp_path, "demos", software_hash())
    kept.keep(json.dumps({"effect": "lag", "seed": 3}, sort_keys=True), answer("lag 3", "lag", ["lag"]))
    page = tmp_path / "page.md"
    page.write_text(PAGE)
    assert main(["lag:3", "none:1", "--known", "--folder", str(tmp_path), "--page", str(page)]) == 0
    text = page.read_text()
    assert "| lag 3 | lag (play) | lag |" in text
    assert "last year" not in text
    assert text.endswith(f"{END}\n\nAfter it.\n")


@pytest.mark.slow
def test_a_demo_is_asked_of_a_real_service(tmp_path: Path):
    [found] = answers([("cross_coupling", 3)], tmp_path, take_s=10.0)
    assert found["hidden"]["right"]
    assert found["error_fall_deg"]["with_effect"] < found["error_fall_deg"]["lmc_gpr"]
    assert found["told"]
    assert found["wrong"] == []


def test_what_is_no_demo_is_refused(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        main(["creep"])
    assert "creep:4" in capsys.readouterr().err
