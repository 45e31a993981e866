"""From a finding to its action: a base that lacks a product of its own sensors, a coupling without a name."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from cli_running import Run

from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes

SENSORS = ("IM_ABD", "I_MCP", "M_MCP")
STRETCH_DEG = 8.0
CLEAN_DEG = 0.35
"""Of a model that knows everything; the reference's own noise is 0.2 degrees."""
FEW = ("--samples", "300")


def stretched(takes: tuple[Take, ...]) -> list[Take]:
    """The abduction's sensor also reads the product of both flexions, up to so many degrees."""
    flexion = [take.reference_at_frames(SENSORS) for take in takes]
    every = np.concatenate(flexion)
    low, span = np.nanmin(every, axis=0), np.ptp(every, axis=0)
    result = []
    for take, angles in zip(takes, flexion, strict=True):
        bent = (angles - low) / span
        readings = take.readings.astype(float)
        counts_per_deg = np.polyfit(angles[:, 0], readings[:, 0], 1)[0]
        readings[:, 0] += np.round(counts_per_deg * STRETCH_DEG * bent[:, 1] * bent[:, 2])
        result.append(dataclasses.replace(take, readings=readings))
    return result


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six takes, and two layouts: ``reads.toml``, whose abduction is read from all, and ``alone.toml``."""
    folder = tmp_path_factory.mktemp("actions")
    plan = SessionPlan(
        5, sensors=SENSORS, take_s=20, rate_hz=30, wearings=2, takes_per_wearing=3, bits=12, nuisance="white",
        reference_white_deg=0.2, reference_lasting_deg=0.1, sensor_noise_deg=0.1,
    )  # fmt: skip
    write_takes(stretched(record_session(plan, []).takes), folder / "takes.csv")
    for name, read in (("reads", SENSORS), ("alone", SENSORS[:1])):
        text = f'name = "{name}"\nsensors = {json.dumps(SENSORS)}\n[rotations]\nIM_ABD = {json.dumps(read)}\n'
        (folder / f"{name}.toml").write_text(text + 'I_MCP = ["I_MCP"]\nM_MCP = ["M_MCP"]\n')
    return folder / "takes.csv"


def trained(run: Run, table: Path, layout: str, method: str) -> str:
    imported = run("take", "import", table, "-s", "abby", "--layout", table.parent / f"{layout}.toml")
    assert imported.code == 0, imported.err
    return run("train", "-s", "abby", "--method", method, *FEW, "--json").json["result"]["model"]


def test_a_straight_line_that_lacks_a_product_is_trained_otherwise(run: Run, table: Path) -> None:
    model = trained(run, table, "reads", "linear")
    page = table.parent / "diagnosis.html"
    answer = run("diagnose", model, "--report", page)
    assert answer.code == 0, answer.err
    assert "\nnonlinearity on IM_ABD" in answer.out
    assert "The base is a straight line" in answer.out
    assert (
        "IM_ABD: the residual is associated with the angle of I_MCP, which the layout gives it" in answer.out
    )
    command = "glovecal train --subject abby --method lmc_gpr"
    assert f"\nNext: {command}\n" in answer.out
    shown = page.read_text()
    table_of = shown[shown.index('<h2 id="what-to-do-about-it">') :]
    assert "method lmc_gpr" in table_of
    assert shown.count(command) == 2
    before = run("model", "show", model, "--json").json
    after = run(*command.split()[1:], *FEW, "--json").json["model"]
    errors = [
        next(row["held_out_rmse_deg"] for row in one["rotations"] if row["rotation"] == "IM_ABD")
        for one in (before, after)
    ]
    assert errors[0] > 1.5
    assert errors[1] < CLEAN_DEG


def test_a_coupling_without_a_name_is_added_shown_and_taken_out(run: Run, table: Path) -> None:
    """By the column that the error goes along with. One with a name has its form as numbers and picture."""
    model = trained(run, table, "alone", "linear")
    answer = run("add-effect", model, "column:I_MCP", "--rotation", "IM_ABD", "--activate", "--json").json
    assert answer["added"]
    assert answer["after"]["IM_ABD"] < 0.6 * answer["before"]["IM_ABD"]
    child = answer["model"]
    assert "column:I_MCP  IM_ABD" in run("model", "show", child).out
    assert "why is not known" in run("effects", "column:I_MCP").out
    told = run("explain", child, "--take", "w1-t2", "--at", "5", "--rotation", "IM_ABD")
    assert "column:I_MCP" in told.out
    removed = run("remove-effect", child, "column:I_MCP", "--json").json
    assert run("model", "show", removed["model"], "--json").json["effects"] == []

    named = run("add-effect", child, "cross_coupling", "-r", "IM_ABD", "--json").json
    curves = named["curves"]["IM_ABD"]
    details = run("model", "show", named["model"], "--json").json["effect_details"]
    assert next(item for item in details if item["effect"] == "cross_coupling")["curves"]["IM_ABD"] == curves
    assert {item["input"] for item in curves["inputs"]} == {"I_MCP", "M_MCP"}
    slope = {item["input"]: item["slope_deg_per_unit"] for item in curves["inputs"]}
    assert named["parameters"]["IM_ABD"]["slope_deg_per_SD[M_MCP]"] == slope["M_MCP"] < 0
    page = table.parent / "compared.html"
    assert run("compare", named["model"], "-t", "w1-t2", "--report", page).code == 0
    assert "adds to IM_ABD, degrees" in page.read_text()
    assert "I_MCP, SD of training" in page.read_text()
