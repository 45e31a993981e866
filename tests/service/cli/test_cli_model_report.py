"""``glovecal model report``: a stored calibration on a few pages, from what its folder holds."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pypdfium2
import pytest
from cli_running import Run, glovecal
from unpacked_example import unpacked_example

from glovecal_service.plain import read
from glovecal_service.report.calibration_answer import CalibrationReport


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The command on a folder with models that have effects, a diagnosis and a whole improvement."""
    return partial(glovecal, {"GLOVECAL_DATA": str(unpacked_example(tmp_path_factory.mktemp("stored")))})


def test_what_a_calibration_rests_on_and_leaves(run: Run, tmp_path: Path) -> None:
    models = run("model", "list", "--json").json
    model = next(item for item in models if item["effects"] == ["hysteresis"] and item["active"])
    shown = run("model", "show", model["id"], "--json").json
    file = tmp_path / "anna.pdf"
    found = read(CalibrationReport, run("model", "report", model["id"], "--report", file, "--json").json)
    assert [take.id for take in found.trained_on] == [take["id"] for take in model["facts"]["takes"]]
    errors = {item["rotation"]: item["held_out_rmse_deg"] for item in shown["rotations"]}
    assert {item.rotation: item.held_out_rmse_deg for item in found.rotations} == errors
    for item in found.rotations:
        assert item.floor is not None
        assert (item.linear_rmse_deg or 0.0) > (item.held_out_rmse_deg or 0.0) > item.floor.floor_deg
    [effect] = found.effects
    assert effect.evidence["rmse_after_deg"] < effect.evidence["rmse_control_deg"]
    assert found.diagnosis is not None
    assert found.diagnosis.model == model["id"]
    assert found.advice
    assert {item.name for item in found.covered_angles} == set(errors)
    written = "".join(page.get_textpage().get_text_range() for page in pypdfium2.PdfDocument(file))
    for text in (*(take.name for take in found.trained_on), "hysteresis", found.next_command):
        assert text in written
    refused = run("model", "report", model["id"], "--report", file)
    assert refused.code == 1
    assert "exists already" in refused.said
