"""``glovecal explain``: the table for people, the document for programs, and what is refused."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from cli_running import Run, glovecal
from effect_models import CREEP, HYSTERESIS, model_with
from realtime_support import LAYOUT

from glovecal_models.calibration.artifact import dump
from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes
from glovecal_service.settings import Settings
from glovecal_service.store import Store

MODEL = model_with(HYSTERESIS, CREEP)


@pytest.fixture(scope="module")
def explained(tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, str]:
    """The command on a folder with a take and a model with effects, and the model's id."""
    folder: Path = tmp_path_factory.mktemp("explain")
    run = partial(glovecal, {"GLOVECAL_DATA": str(folder / "data")})
    time_s = np.arange(400) / 100.0
    readings = np.round(120 + 60 * np.sin(time_s[:, None] * [1.0, 1.7, 2.3]))
    take = Take(
        "pinch", "monday", LAYOUT.sensors, time_s, readings, LAYOUT.rotations, time_s, 0.5 * (readings - 100)
    )
    write_takes([take], folder / "pinch.csv")
    run("subject", "add", "anna")
    imported = run("take", "import", folder / "pinch.csv", "-s", "anna", "--json")
    assert imported.code == 0, imported.err
    layout = run("take", "list", "--json").json[0]["layout"]
    with Store.open(Settings(data=folder / "data")) as store:
        record = store.models.add(
            dump(MODEL), subject="anna", layout=layout, method="linear", parent=None, facts={}
        )
    return run, record.id


def test_a_table_for_people(explained: tuple[Run, str]) -> None:
    run, model = explained
    answer = run("explain", model, "--take", "pinch", "--at", "1.5", "--rotation", "I_MCP")
    assert answer.code == 0, answer.err
    lines = answer.out.splitlines()
    assert lines[0] == f"Model {model[:12]} (linear), take pinch of monday, frame 150 at 1.500 s:"
    assert lines[1].startswith("Transient: hysteresis, creep began anew 1.5 s ago and settles after 2.5 s")
    assert [line.split()[0] for line in lines if line.startswith(("base", "hyst", "creep", "angle"))] == [
        "base", "hysteresis", "creep", "angle",
    ]  # fmt: skip
    assert "not stored" in answer.out
    assert "from raw readings I_MCP 180." in answer.out
    assert "Measured: 40.00 degrees; error" in answer.out
    assert "I_PIP" not in answer.out


def test_a_document_whose_terms_add_up(explained: tuple[Run, str]) -> None:
    run, model = explained
    found = run("explain", model, "-t", "pinch", "--at", "3.14", "--json").json
    assert [item["rotation"] for item in found["rotations"]] == list(LAYOUT.rotations)
    assert (found["frame"], found["sentences"]) == (314, [])
    for item in found["rotations"]:
        assert abs(sum(term["degrees"] for term in item["terms"]) - item["degrees"]) < 1e-9
        assert item["measured"]["error_deg"] == pytest.approx(
            item["degrees"] - item["measured"]["recorded_deg"]
        )


def test_what_is_refused(explained: tuple[Run, str]) -> None:
    run, model = explained
    late = run("explain", model, "-t", "pinch", "--at", "9")
    assert late.code == 1
    assert "lasts from 0.000 to 3.990 s; there is no 9 s" in late.said
    nobody = run("explain", model, "-t", "pinch", "--at", "1", "-r", "W_FLEX")
    assert nobody.code == 1
    assert "no rotation 'W_FLEX' in this model; there are I_MCP, I_PIP, M_MCP" in nobody.said
    assert "no take 'fist'" in run("explain", model, "-t", "fist", "--at", "1").said
