"""A data folder that was made before is used as it stands: models, predictions, jobs and their pages.

``stored_example/make_example.py`` made it by the command line from simulated takes: LMC-GPR with hysteresis
and with a donning shift, a linear calibration with a declared effect, a diagnosis, a whole improvement.
"""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from cli_running import glovecal
from unpacked_example import unpacked_example

from glovecal_models.calibration import artifact
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.takes.table import read_takes
from glovecal_service.questions.catalogue import ANSWERED
from glovecal_service.rest.in_process import in_process_client
from glovecal_service.settings import Settings

STORED = Path(__file__).parents[1] / "stored_example"
EXPECTED = json.loads((STORED / "expected.json").read_text(encoding="utf-8"))
EVERY_SO_MANY = 40
"""Frames between those whose poses are kept."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return unpacked_example(tmp_path_factory.mktemp("stored"))


@pytest.fixture(scope="module")
def run(folder: Path):
    return partial(glovecal, {"GLOVECAL_DATA": str(folder)})


def test_its_models_are_there_and_say_what_they_hold(run):
    found = {item["id"]: item for item in run("model", "list", "--json").json}
    assert {name: [item["effects"], item["active"]] for name, item in found.items()} == {
        name: [item["effects"], item["active"]] for name, item in EXPECTED["models"].items()
    }
    for name, item in EXPECTED["models"].items():
        shown = run("model", "show", name)
        assert shown.code == 0, shown.err
        assert all(effect in shown.out for effect in item["effects"])


@pytest.mark.parametrize("name", EXPECTED["models"])
def test_each_model_predicts_what_it_predicted(folder: Path, name: str):
    model = artifact.load((folder / "artifacts" / name).read_bytes())
    [take] = read_takes(folder / "unseen.csv")
    readings = take.readings[:, [take.sensors.index(sensor) for sensor in model.layout.sensors]]
    angles = GlovePredictor(model).predict_take(take.time_s, readings, take.context, take.wearing)
    for part in ("mean", "sd"):
        values = np.array(getattr(angles, part)[::EVERY_SO_MANY])
        np.testing.assert_allclose(values, EXPECTED["predicted"][name][f"{part}_deg"], atol=1e-7)


@pytest.mark.parametrize("job", EXPECTED["jobs"])
def test_each_job_is_shown(run, job: str):
    shown = run("job", "show", job)
    assert shown.code == 0, shown.err
    found = run("job", "show", job, "--json").json
    assert found["state"] == "done"
    kind, result = found["kind"], found["result"]
    assert set(ANSWERED[kind].answer.__dataclass_fields__) == set(result), "with the keys of today"


@pytest.mark.parametrize("job", EXPECTED["jobs"])
def test_each_diagnosis_and_improvement_still_has_its_page(folder: Path, job: str):
    with in_process_client(Settings(data=folder)) as client:
        kind = client.get(f"/jobs/{job}")["kind"]
        if kind not in ("diagnose", "improve"):
            return
        page = client.download(f"/jobs/{job}/report").decode()
    title = page[page.index("<h1>") : page.index("</h1>")]
    assert "version" in title or kind == "improve", "an improvement stored before has no title of its model"
    assert "<dt>Next</dt><dd><code>glovecal " in page
    assert "control" in page


def test_it_goes_on_from_there(run, folder: Path):
    assert run("take", "import", folder / "unseen.csv", "-s", "anna").code == 0
    compared = run("compare", EXPECTED["active"])
    assert compared.code == 0, compared.err
    assert run("remove-effect", EXPECTED["active"], "hysteresis").code == 0
