"""``train --method auto`` from tables to the shown choice, over the same REST that a server speaks."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from cli_running import glovecal
from unknown_sensors import LAYOUT, POLYNOMIAL_GLOVE, flex_takes

ROTATIONS = ("I_PIP", "P_PIP")
SENTENCE = "I_PIP: a polynomial of degree 2 fits best: "


@pytest.fixture(scope="module")
def flex(tmp_path_factory: pytest.TempPathFactory):
    """A runner on a data folder with a model of ``anna`` trained with auto; take free-4 is left out."""
    folder = tmp_path_factory.mktemp("flex")
    for take in flex_takes(POLYNOMIAL_GLOVE, 0, 5, 60, product=1.0):
        columns = [take.rotations.index(name) for name in ROTATIONS]
        names = ["time_s", *(f"s.{name}" for name in take.sensors), *(f"r.{name}" for name in ROTATIONS)]
        table = np.column_stack([take.time_s, take.readings, take.reference[:, columns]])
        np.savetxt(
            folder / f"{take.name}.csv", table, delimiter=",", header=",".join(names), comments="", fmt="%.6g"
        )
    lines = "\n".join(f'{name} = ["{name[0]}"]' for name in ROTATIONS)
    quoted = ", ".join(f'"{name}"' for name in LAYOUT.sensors)
    (folder / "flex.toml").write_text(f'name = "flex"\nsensors = [{quoted}]\n[rotations]\n{lines}\n')
    run = partial(glovecal, {"GLOVECAL_DATA": str(folder / "data")})
    assert run("subject", "add", "anna").code == 0
    files: list[Path] = sorted(folder.glob("free-*.csv"))
    assert run("take", "import", *files, "-s", "anna", "--layout", folder / "flex.toml").code == 0
    trained = run("train", "-s", "anna", "--method", "auto", "--leave-out", "free-4", "--folds", 0)
    return run, trained


def test_training_says_what_was_chosen_and_why(flex) -> None:
    _, trained = flex
    assert trained.code == 0, trained.err
    assert "(auto) for anna" in trained.out
    assert SENTENCE in trained.said
    assert "degrees on takes left out against" in trained.said
    assert "P_PIP: a polynomial of degree 3 fits best: " in trained.said


def test_the_model_shows_each_candidate_with_its_evidence_and_error(flex) -> None:
    run, _ = flex
    (row,) = run("model", "list", "--json").json
    assert row["method"] == "auto"
    shown = run("model", "show", row["id"], "--json").json
    assert [item["method"] for item in shown["rotations"]] == ["polynomial_gpr", "polynomial_gpr"]
    choice = shown["rotations"][0]["kernel_choice"]
    assert choice["sentence"].startswith(SENTENCE)
    assert choice["samples"] == 240
    first, second = choice["candidates"][:2]
    assert (first["kernel"], first["chosen"], first["evidence_gain"]) == ("lmc_gpr", False, 0)
    assert (second["kernel"], second["chosen"]) == ("polynomial_2", True)
    assert second["held_out_rmse_deg"] < first["held_out_rmse_deg"] < choice["straight_line_deg"]
    assert second["nlml"] < first["nlml"]
    read = run("model", "show", row["id"])
    assert (
        max(len(line) for line in read.out.splitlines() if not line.endswith(".")) <= 80
    )  # sentences end so
    table = [line.split() for line in read.out.splitlines()]
    assert ["I_PIP", "straight", "line", "-", f"{choice['straight_line_deg']:.2f}", "-", "-"] in table
    assert ["I_PIP", "polynomial_2", "yes", f"{second['held_out_rmse_deg']:.2f}"] in [
        line[:4] for line in table
    ]
    assert SENTENCE in read.said


def test_it_is_compared_and_diagnosed_like_any_other(flex) -> None:
    run, _ = flex
    (row,) = run("model", "list", "--json").json
    compared = run("compare", row["id"], "--take", "free-4", "--json").json[row["id"]]
    assert compared["rotations"]["I_PIP"]["rmse_deg"] < 1.5
    assert run("diagnose", row["id"], "--json").json["named"] is None


def test_improve_walks_on_the_kernels_that_fit(flex) -> None:
    run, _ = flex
    walked = run("improve", "-s", "anna", "--method", "auto", "--max-steps", 0, "--json").json
    last = run("model", "show", walked["steps"][-1]["model"], "--json").json
    assert {item["method"] for item in last["rotations"]} == {"polynomial_gpr"}
    assert last["rotations"][0]["kernel_choice"]["sentence"].startswith(SENTENCE)
