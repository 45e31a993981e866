"""``glovecal quick-check``: its table, its document, and whom it asks back."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from cli_running import glovecal
from realtime_support import LAYOUT, linear_model

from glovecal_models.calibration.artifact import dump
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes
from glovecal_service.settings import Settings
from glovecal_service.store import Store


def test_a_new_wearing_is_checked_from_the_command_line(tmp_path: Path) -> None:
    model = linear_model("anna", degrees_per_count=0.5)
    run = partial(glovecal, {"GLOVECAL_DATA": str(tmp_path / "data")})
    held = np.repeat(np.array([[60.0, 70.0, 80.0], [180.0, 90.0, 190.0], [120.0, 190.0, 120.0]]), 50, axis=0)
    angles, time = GlovePredictor(model).predict(held).mean, np.arange(150) / 50.0
    poses = tuple(name for name in ("flat", "fist", "spread") for _ in range(50))
    shifted = held + np.array([12, -9, 0])
    take = Take(
        "check", "tuesday", LAYOUT.sensors, time, shifted, LAYOUT.rotations, time, angles, poses=poses
    )
    late = replace(take, name="late", wearing="wednesday", readings=held + np.array([0, 5, 5]))
    write_takes([take, late], tmp_path / "takes.csv")
    with Store.open(Settings(data=tmp_path / "data")) as store:
        store.subjects.create("anna")
        store.layouts.put(LAYOUT)
        record = store.models.add(
            dump(model), subject="anna", layout=LAYOUT.name, method="linear", parent=None, facts={}
        )
        store.models.activate(record.id)
    imported = run("take", "import", tmp_path / "takes.csv", "-s", "anna", "--layout", LAYOUT.name)
    assert imported.code == 0, imported.err
    answer = run("quick-check", "--subject", "anna", "--take", "check", "--activate")
    assert answer.code == 0, answer.err
    assert "pose fist at 1.3 s of take check" in answer.out
    assert "3 poses: the expected error in this wearing falls from" in answer.out
    assert f"made from {record.id[:12]}. Active.\n" in answer.out
    assert "full calibration (°)" in answer.out
    assert "As found: " in answer.out
    assert "as left (°)" in run("subject", "history", "anna").out
    document = run("quick-check", "-s", "anna", "-t", "late", "--json").json
    assert document["parent"] != record.id, "the active model: what was learned of tuesday stays"
    by_sensor = {item["sensor"]: item["readings"] for item in document["sensors"]}
    assert 3 < by_sensor["I_PIP"] < 7
    assert run("quick-check", "--take", "check").code == 2
    assert "--take NAME" in run("quick-check", record.id[:8]).said
    again = run("quick-check", record.id[:8], "--take", "check", "--take", "late")
    assert again.code == 1
    assert "2 wearings (tuesday, wednesday); check one at a time" in again.said
