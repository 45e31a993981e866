"""``glovecal detectable`` on files of a small simulated session: table, JSON, page, refusals."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest
from cli_running import Run, glovecal

from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.write_table import write_takes


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, Path]:
    """The command on a folder with six takes of two sensors of subject anna."""
    folder = tmp_path_factory.mktemp("detectable")
    run = partial(glovecal, {"GLOVECAL_DATA": str(folder / "data")})
    plan = SessionPlan(3, sensors=("I_MCP", "I_PIP"), take_s=10, wearings=2, takes_per_wearing=3)
    write_takes(list(record_session(plan).takes), folder / "takes.csv")
    run("subject", "add", "anna")
    assert run("take", "import", folder / "takes.csv", "-s", "anna").code == 0
    return run, folder


def test_a_subject_before_any_model(session: tuple[Run, Path]) -> None:
    run, folder = session
    asked = (
        "detectable",
        "anna",
        "--effect",
        "hysteresis",
        "-r",
        "I_PIP",
        "--sizes",
        "4,0.02",
        "--trials",
        1,
    )
    page = folder / "page.html"
    answer = run(*asked, "--report", page)
    assert answer.code == 0, answer.err
    assert "What 6 takes of anna (simulated glove) could have shown:" in answer.out
    assert (
        "hysteresis on I_PIP: 4 degrees would have been named (1 of 1 trials), 0.02 degrees would not (0 of 1"
        " trials)."
    ) in answer.out
    assert "Control: with nothing put in nothing is named in 1 of 1 trials." in answer.out
    assert "clock_offset and glove_latency  I_" in answer.out
    shown = page.read_text(encoding="utf-8")
    assert "What 6 takes of anna (simulated glove) could have shown" in shown
    assert shown.count("<figure") == shown.count("<svg") == 1
    found = run(*asked, "--json").json
    [item] = found["effects"]
    assert [(size["size_deg"], size["named"], size["not_found"]) for size in item["sizes"]] == [
        (0.02, 0, 1),
        (4.0, 1, 0),
    ]
    assert 0.02 < item["named_50_deg"] < item["named_80_deg"] < 4
    assert found["model"] is None
    assert 0.3 < found["residual_deg"]["I_PIP"] < 1.5


def test_a_model_that_has_the_effect_and_one_of_ones_own(session: tuple[Run, Path]) -> None:
    run, _ = session
    trained = run("train", "-s", "anna", "--method", "linear", "--json").json["result"]["model"]
    asked = ("--sizes", "4", "--trials", 1, "--json")
    own = "name = warm_board; columns = c.temperature_c * own; unit = deg"
    found = run("detectable", trained, "--effect", "saturation", "-e", own, *asked).json
    by_name = {item["effect"]: item for item in found["effects"]}
    assert set(by_name) == {"saturation", "warm_board"}
    assert "found by its signature" in by_name["saturation"]["why_not"]
    assert by_name["saturation"]["sizes"] == []
    assert by_name["warm_board"]["why_not"] is None
    assert by_name["warm_board"]["sizes"][0]["trials"] == 1
    assert found["model"].startswith(trained)


def test_what_is_refused(session: tuple[Run, Path]) -> None:
    run, _ = session
    assert "no rotation 'W_FLEX' in this layout" in run("detectable", "anna", "-r", "W_FLEX").said
    assert "no effect 'glue'" in run("detectable", "anna", "--effect", "glue").said
    assert run("detectable", "anna", "--sizes", "big").code == 2
    assert run("detectable", "anna", "--sizes", "-1").code == 1
