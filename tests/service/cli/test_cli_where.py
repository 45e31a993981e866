"""``glovecal where`` and ``glovecal take clocks``: what users read, programs read, and what is written."""

from __future__ import annotations

import dataclasses
from functools import partial
from pathlib import Path

import pytest
from cli_running import Run, glovecal, simulated

from glovecal_models.takes.write_table import write_takes


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory, tables: Path) -> tuple[Run, str]:
    """The command on a folder of its own with a linear model, and the model's id."""
    run = partial(glovecal, {"GLOVECAL_DATA": str(tmp_path_factory.mktemp("where") / "data")})
    run("subject", "add", "anna")
    imported = run("take", "import", tables / "train.csv", tables / "test.frames.csv", "-s", "anna")
    assert imported.code == 0, imported.err
    options = ("--method", "linear", "--folds", "0", "--leave-out", "second", "--json")
    return run, run("train", "-s", "anna", *options).json["result"]["model"]


def test_sentences_for_people_with_the_worst_rotation_first(trained: tuple[Run, str]) -> None:
    run, model = trained
    answer = run("where", model[:8])
    assert answer.code == 0, answer.err
    first, *_ = answer.out.splitlines()
    assert first.startswith("Where the model fails on 1 take of anna, version 1 of ")
    assert f" (linear, {model[:12]}; simulated glove):" in first
    assert "\nTakes: second\n" in answer.out
    assert "W_FLEX: RMSE" in answer.out
    assert answer.out.index("RMSE 1") < answer.out.index("RMSE 2.")
    assert "noise floor" in answer.out
    assert "The worst seconds:" in answer.out
    assert "Noise floors:" not in answer.out
    floors = run("where", model[:8], "--floors").out
    assert "still joint" in floors
    assert "frame to frame" in floors


def test_json_for_programs_and_a_page_for_everybody(trained: tuple[Run, str], tmp_path: Path) -> None:
    run, model = trained
    page = tmp_path / "second.html"
    found = run("where", model, "--take", "second", "--json", "--report", page).json
    assert {item["rotation"] for item in found["rotations"]} >= {"W_FLEX", "IM_ABD", "I_PIP"}
    assert all(item["floor"]["floor_deg"] > 0 for item in found["rotations"])
    assert page.read_text().startswith("<!doctype html>")
    assert "simulated" in page.read_text()
    again = run("where", model, "--report", page)
    assert again.code == 1
    assert "exists already" in again.said


def test_a_take_the_model_has_seen_is_told(trained: tuple[Run, str]) -> None:
    run, model = trained
    answer = run("where", model, "--take", "poses")
    assert answer.code == 0, answer.err
    assert "was trained on 1 of these takes (poses)" in answer.out


def test_clocks_are_found_repaired_and_put_back(run: Run, tmp_path: Path) -> None:
    take = simulated("evaluation", "late")
    write_takes(
        [dataclasses.replace(take, reference_time_s=take.reference_time_s + 0.4)], tmp_path / "late.csv"
    )
    write_takes([simulated("free", "right")], tmp_path / "right.csv")
    run("subject", "add", "anna")
    for file in ("late.frames.csv", "right.csv"):
        assert run("take", "import", tmp_path / file, "-s", "anna").code == 0
    looked = run("take", "clocks")
    assert "Take late: the reference clock is 0.40 s ahead of the glove's" in looked.out
    assert "Take right: the clocks agree." in looked.out
    assert "1 of 2 references are off" in looked.out
    assert "Repaired 1 of 2 references" in run("take", "clocks", "--repair").out
    assert "Take late: the clocks agree." in run("take", "clocks", "late").out
    assert run("take", "clocks", "--undo").out == "Moved 1 of 2 references back.\n"
    assert run("take", "clocks", "late", "--json").json[0]["verdict"] == "offset"
    both = run("take", "clocks", "--repair", "--undo")
    assert both.code == 2
    assert "not both" in both.said


def test_nothing_to_examine(run: Run) -> None:
    answer = run("take", "clocks")
    assert answer.code == 1
    assert "there is no take with reference angles" in answer.said
