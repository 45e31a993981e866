"""``glovecal model list`` and ``show`` of a model with effects."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

from cli_running import glovecal
from effect_models import CREEP, HYSTERESIS, UNITS, added, model_with

from glovecal_models.calibration.artifact import dump
from glovecal_models.calibration.text import model_effect
from glovecal_service.cli.model.models import effect_rows
from glovecal_service.settings import Settings
from glovecal_service.store import Store


def test_a_models_effects_are_shown_with_units_and_evidence(tmp_path: Path) -> None:
    hysteresis = replace(HYSTERESIS, evidence={"rmse_before_deg": 5.5, "rmse_after_deg": 1.25})
    model = model_with(hysteresis, CREEP)
    with Store.open(Settings(data=tmp_path / "data")) as store:
        store.subjects.create("anna")
        record = store.models.add(
            dump(model), subject="anna", layout=model.layout.name, method="linear", parent=None, facts={}
        )
    run = partial(glovecal, {"GLOVECAL_DATA": str(tmp_path / "data")})
    assert "hysteresis, creep" in run("model", "list").out
    shown = run("model", "show", record.id[:8])
    assert shown.code == 0, shown.err
    lines = shown.out.splitlines()
    first = next(line for line in lines if line.startswith("hysteresis"))
    assert "I_MCP" in first
    assert "widest_play_deg 5" in first
    assert "rmse_after_deg 1.25, rmse_before_deg 5.50" in first
    assert sum("widest_play_deg 5" in line for line in lines) == 3
    assert sum("slow_tau_s 2.5" in line for line in lines) == 2
    document = run("model", "show", record.id[:8], "--json").json
    assert [item["effect"] for item in document["effect_details"]] == ["hysteresis", "creep"]


def test_many_numbers_are_counted() -> None:
    wearings = [f"w{number}" for number in range(10)]
    shift = added("donning_shift", (), range(1, 21), ("I_PIP",), settings={"wearings": wearings, **UNITS})
    assert effect_rows([model_effect(shift)])[0]["numbers"].endswith("and 12 more")
