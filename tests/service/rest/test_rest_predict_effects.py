"""Predicting over REST with effects: a take with its times, and what is refused or said without them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from effect_models import CREEP, HYSTERESIS, LAG, UNITS, added, model_with

from glovecal_client.rest import Refused, RestClient
from glovecal_models.calibration import artifact
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_service.rest.in_process import in_process_client
from glovecal_service.settings import Settings
from glovecal_service.store import Store

SHIFT = added("donning_shift", (), (3.0, 0.0), settings={"wearings": ["monday"], **UNITS})
GRIP = added("contact_pressure", (), (4.0, 0.0), settings={"low": 4.0, "high": 5.0, "usual": 5.0, **UNITS})
REMEMBERS, INSTANT = model_with(HYSTERESIS, CREEP, LAG), model_with(SHIFT, GRIP)
RANDOM = np.random.default_rng(3)
READINGS = 120 + np.cumsum(RANDOM.normal(0, 3, (80, 3)), axis=0)
TIME_S = np.cumsum(RANDOM.uniform(0.005, 0.015, 80))


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("effects") / "data"


@pytest.fixture(scope="module")
def keep(data: Path) -> Callable[[CalibrationModel], str]:
    def keep(model: CalibrationModel) -> str:
        with Store.open(Settings(data=data)) as store:
            if not store.subjects.list():
                store.subjects.create("anna")
            content, method = artifact.dump(model), model.method
            layout = model.layout.name
            record = store.models.add(
                content, subject="anna", layout=layout, method=method, parent=None, facts={}
            )
        return record.id

    return keep


@pytest.fixture(scope="module")
def client(data: Path) -> Iterator[RestClient]:
    with in_process_client(Settings(data=data)) as client:
        yield client


def test_frames_with_times_are_predicted_as_one_take(client: RestClient, keep: Any) -> None:
    answer = client.predict(keep(REMEMBERS), READINGS, time_s=TIME_S)
    expected = GlovePredictor(REMEMBERS).predict_take(TIME_S, READINGS, {}, "")
    np.testing.assert_array_equal(answer["mean_deg"], expected.mean)
    assert answer["effects"] == ["hysteresis", "creep", "lag"]
    assert (answer["settling_s"], answer["sentences"]) == (2.5, [])
    assert np.abs(expected.mean - GlovePredictor(REMEMBERS).predict(READINGS).mean).max() > 0.5


def test_without_times_a_model_that_remembers_says_what_to_send(client: RestClient, keep: Any) -> None:
    with pytest.raises(Refused, match=r"hysteresis, creep, lag.*send time_s, seconds for each of the 80"):
        client.predict(keep(REMEMBERS), READINGS)


def test_effects_without_memory_need_no_times(client: RestClient, keep: Any) -> None:
    model, base = keep(INSTANT), GlovePredictor(INSTANT).predict(READINGS).mean
    answer = client.predict(model, READINGS)
    np.testing.assert_allclose(answer["mean_deg"], base)
    assert answer["sentences"] == [
        "nobody said which wearing this is: donning_shift is not corrected",
        "context contact_n is not sent: contact_pressure is not corrected",
    ]
    degrees = np.where(np.arange(80) < 40, np.nan, 4.5)
    answer = client.predict(model, READINGS, context={"contact_n": degrees}, wearing="monday")
    correction = np.array(answer["mean_deg"]) - base
    np.testing.assert_allclose(correction[:, 0], np.where(np.arange(80) < 40, 3.0, 1.0))
    assert answer["sentences"] == []
    other = client.predict(model, READINGS, context={"contact_n": degrees}, wearing="friday")
    assert other["sentences"] == ["wearing 'friday' was not in training: donning_shift is not corrected"]


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"time_s": TIME_S[:5]}, "time_s has 5 values for 80 frames"),
        ({"time_s": TIME_S[::-1]}, "time_s must increase, but frame 1 is at"),
        ({"time_s": TIME_S, "context": {"supply_v": [1.0]}}, "context supply_v has 1 values for 80 frames"),
        ({"context": {"no name": [1.0]}}, "context"),
        ({"wearing": ""}, "wearing"),
    ],
)
def test_what_cannot_be_a_take_is_refused(client: RestClient, keep: Any, changed: Any, says: str) -> None:
    with pytest.raises(Refused) as refused:
        client.predict(keep(REMEMBERS), READINGS, **changed)
    assert refused.value.status == 422
    assert says in f"{refused.value} {refused.value.problem}"


def test_a_model_lists_its_effects(client: RestClient, keep: Any) -> None:
    models = [keep(REMEMBERS), keep(INSTANT)]
    listed = {row["id"]: row["effects"] for row in client.get("/models")}
    assert [listed[model] for model in models] == [
        ["hysteresis", "creep", "lag"],
        ["donning_shift", "contact_pressure"],
    ]
    creep = client.get(f"/models/{models[0]}")["effect_details"][1]
    assert (creep["effect"], creep["rotations"]) == ("creep", ["I_MCP", "M_MCP"])
    learned = {"fast_tau_s": 0.5, "slow_tau_s": 2.5, "slow_share_deg_per_deg": 0.15}
    assert learned.items() <= creep["parameters"]["I_MCP"].items()
    assert (creep["has_memory"], creep["settling_s"], creep["evidence"]) == (True, 2.5, {})
    assert client.get(f"/models/{models[1]}")["effect_details"][1]["context"] == ["contact_n"]
