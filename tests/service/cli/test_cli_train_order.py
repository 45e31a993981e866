"""``glovecal train`` on a ramp of poses says that posture goes with time; it trains all the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cli_running import Run

from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes

RAMP = tuple(range(0, 100, 10))


@pytest.mark.parametrize("order", ["ramp", "random"])
def test_a_ramp_is_told_and_a_random_order_is_not(run: Run, tmp_path: Path, order: str) -> None:
    random = np.random.default_rng(6)
    levels = RAMP if order == "ramp" else random.permutation(RAMP)
    angles = np.repeat(np.array(levels, dtype=float), 40)[:, None] + random.normal(0, 1, (400, 1))
    time_s = np.arange(400) / 20.0
    take = Take("poses", "monday", ("I_MCP",), time_s, np.round(60 + angles), ("I_MCP",), time_s, angles)
    write_takes([take], tmp_path / "poses.csv")
    assert run("take", "import", tmp_path / "poses.csv", "-s", "anna").code == 0
    options = ("--method", "linear", "--folds", "0", "-s", "anna")
    answer = run("train", *options)
    assert answer.code == 0, answer.err
    assert ("In monday posture goes with time: R2 of time by angle is I_MCP 0.9" in answer.said) == (
        order == "ramp"
    )
    found = run("train", *options, "--json").json["result"]["confounded_order"]
    assert [item["rotation"] for item in found] == (["I_MCP"] if order == "ramp" else [])
