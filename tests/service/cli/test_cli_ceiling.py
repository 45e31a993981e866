"""``glovecal ceiling`` from files to the verdict, and where it is shown afterwards; takes are simulated."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from cli_running import glovecal  # pyright: ignore[reportMissingImports]

from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.write_table import write_takes


def test_the_verdict_is_shown_wherever_the_floor_is(tmp_path: Path) -> None:
    run = partial(glovecal, {"GLOVECAL_DATA": str(tmp_path / "data")})
    plan = SessionPlan(
        seed=2, sensors=("I_PIP",), bits=12, nuisance="white", wearings=2, takes_per_wearing=4, take_s=12.0
    )
    write_takes(record_session(plan, (Cause("lag", "one_pole", 2.0),)).takes, tmp_path / "takes.csv")
    run("subject", "add", "pia")
    assert run("take", "import", tmp_path / "takes.csv", "--subject", "pia").code == 0
    model = run("train", "--subject", "pia", "--samples", 200, "--folds", 0, "--json").json["result"]["model"]
    held = ("--take", "w1-t1", "--json")
    assert run("compare", model, *held).json[model]["ceiling"] is None
    found = run("ceiling", model, "--json").json
    assert found["verdict"] == "gain"
    assert next(iter(found["groups"])) == "history"
    assert run("compare", model, *held).json[model]["ceiling"]["verdict"] == "gain"
    assert run("where", model, *held).json["ceiling"]["sentence"] == found["sentence"]
    page = tmp_path / "where.html"
    run("where", model, "--take", "w1-t1", "--report", page)
    assert "Something is left to gain" in page.read_text(encoding="utf-8")
