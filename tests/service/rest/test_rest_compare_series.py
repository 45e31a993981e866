"""What a page draws of a comparison is what the mathematics gives: series, one column, two hands."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from glovecal_client.rest import Refused, RestClient
from glovecal_models.calibration.artifact import load
from glovecal_models.comparison.dependence import covariates, dependence
from glovecal_models.comparison.fingertips import fingertip_errors
from glovecal_models.comparison.residuals import Residuals, residuals
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_service.rest.in_process import in_process_client
from glovecal_service.settings import Settings
from glovecal_service.store import Store

SENSORS = ("I_MCP", "I_PIP")
FRAMES = 3000


@dataclass(frozen=True)
class Trained:
    client: RestClient
    model: str
    takes: list[str]
    """The first was trained on, the second starts at 100 s of its clock."""
    found: Residuals
    """Of the takes, in this process."""


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Trained]:
    """A linear model of an index finger whose sensors bend, and two takes."""
    folder = tmp_path_factory.mktemp("series")
    settings = Settings(data=folder / "data")
    with in_process_client(settings) as client:
        client.post("/subjects", {"name": "anna"})
        for name in ("finger", "other"):
            layout = folder / f"{name}.toml"
            rows = "\n".join(f'{sensor} = ["{sensor}"]' for sensor in SENSORS)
            layout.write_text(f'name = "{name}"\nsensors = ["I_MCP", "I_PIP"]\n[rotations]\n{rows}\n')
            client.add_layout(layout)
        takes = [_take(client, folder, number) for number in range(2)]
        body = {"subject": "anna", "layout": "finger", "method": "linear", "takes": takes[:1], "folds": 0}
        job = client.wait_for_job(client.post("/models/train", body)["id"])
        model = job["result"]["model"]
        with Store.open(settings) as store:
            kept = load(store.models.load_bytes(model), expected_id=model)
            found = residuals(kept, [store.takes.load(take) for take in takes])
        _take(client, folder, 2, layout="other")
        yield Trained(client, model, takes, found)


def _take(client: RestClient, folder: Path, number: int, layout: str = "finger") -> str:
    generator = np.random.default_rng(number)
    time = 100.0 * number + np.arange(FRAMES) / 60
    angles = 40 + 30 * np.sin(2 * np.pi * np.outer(time, (1 / 7.3, 1 / 4.1)) + number)
    sensors = 100 + angles + 0.004 * (angles - 40) ** 2 + 0.3 * generator.normal(size=angles.shape)
    angles[1000:1100, 0] = np.nan
    file = folder / f"take{number}.csv"
    names = ",".join(["time_s", *(f"s.{name}" for name in SENSORS), *(f"r.{name}" for name in SENSORS)])
    rows = np.column_stack([time, sensors, angles])
    np.savetxt(file, rows, delimiter=",", header=names, comments="", fmt="%.6f")
    return client.upload_takes(file, subject="anna", layout=layout)["takes"][0]["id"]


def test_a_series_is_the_residuals_frame_by_frame(trained: Trained) -> None:
    asked = {"takes": trained.takes, "rotation": "I_PIP", "points": 4000}
    answer = trained.client.post(f"/models/{trained.model}/series", asked)
    column = trained.found.column("I_PIP")
    first, second = answer["takes"]
    assert [first["trained_on"], second["trained_on"]] == [True, False]
    assert second["start_s"] == pytest.approx(100.0)
    assert second["linked_s"] == pytest.approx(first["end_s"] - first["start_s"] + 1.0)
    assert answer["linked_s"] == pytest.approx(second["linked_s"] + (FRAMES - 1) / 60)
    for shown, item in zip(answer["takes"], trained.found.takes, strict=True):
        rows = np.searchsorted(item.take.time_s, np.array(shown["time_s"]))
        for name, right in (
            ("time_s", item.take.time_s),
            ("measured_deg", item.measured[:, column]),
            ("predicted_deg", item.predicted[:, column]),
            ("sd_deg", item.sd[:, column]),
            ("error_deg", item.error[:, column]),
        ):
            np.testing.assert_allclose(np.array(shown[name], float), right[rows], rtol=1e-12)


def test_extremes_stay_and_gaps_break_the_line_with_few_points(trained: Trained) -> None:
    asked = {"takes": trained.takes, "rotation": "I_MCP", "points": 200}
    answer = trained.client.post(f"/models/{trained.model}/series", asked)
    column = trained.found.column("I_MCP")
    assert sum(len(shown["time_s"]) for shown in answer["takes"]) <= 200
    for shown, item in zip(answer["takes"], trained.found.takes, strict=True):
        error = np.array(shown["error_deg"], float)
        assert np.isnan(error).any()
        assert np.nanmax(error) == np.nanmax(item.error[:, column])
        assert np.nanmin(error) == np.nanmin(item.error[:, column])


def test_a_window_has_its_own_points_over_the_end_of_a_take(trained: Trained) -> None:
    """From the last second of the first take to the first of the second."""
    asked = {"takes": trained.takes, "rotation": "I_PIP", "from_s": 48.99, "to_s": 51.99}
    first, second = trained.client.post(f"/models/{trained.model}/series", asked)["takes"]
    assert first["frames"] == len(first["time_s"]) == pytest.approx(61, abs=1)
    assert second["frames"] == len(second["time_s"]) == pytest.approx(62, abs=1)
    outside = trained.client.post(f"/models/{trained.model}/series", asked | {"from_s": 500.0, "to_s": 501.0})
    assert [shown["time_s"] for shown in outside["takes"]] == [[], []]


def test_a_residual_against_a_column_is_the_same_test_as_everywhere(trained: Trained) -> None:
    asked = {"takes": trained.takes, "rotation": "I_PIP", "column": "angle"}
    answer = trained.client.post(f"/models/{trained.model}/residual", asked)
    errors = tuple(item.error[:, trained.found.column("I_PIP")] for item in trained.found.takes)
    angle = next(covariates(trained.found, "I_PIP"))
    right = dependence(errors, angle, np.random.default_rng(0))
    assert right is not None
    assert answer["dependence"]["mean_deg"] == pytest.approx(right.mean_deg)
    assert answer["dependence"]["chance_deg"] == pytest.approx(right.chance_deg)
    assert answer["dependence"]["p_value"] == right.p_value
    assert answer["dependence"]["is_structure"] is True
    assert "the angle itself" in answer["sentence"]
    assert len(answer["value"]) == len(answer["error_deg"]) <= 1500
    names = [one["name"] for one in answer["columns"]]
    assert {"angle", "speed", "direction", "time in take", "sensor I_MCP", "joint I_MCP"} <= set(names)
    assert "joint I_PIP" not in names
    other = trained.client.post(f"/models/{trained.model}/residual", asked | {"column": "joint I_MCP"})
    assert other["dependence"]["explained_deg"] < answer["dependence"]["explained_deg"]


def test_replayed_tips_are_as_far_apart_as_forward_kinematics_says(trained: Trained) -> None:
    asked = {"take": trained.takes[1], "from_s": 102.0, "to_s": 104.0, "frames": 50}
    answer = trained.client.post(f"/models/{trained.model}/replay", asked)
    assert 25 < len(answer["time_s"]) <= 50
    assert 102.0 <= answer["time_s"][0] < answer["time_s"][-1] <= 104.0
    skeleton = hand_skeleton()
    tips = [
        forward_kinematics(skeleton, np.array(answer[name], float)).tips_mm
        for name in ("measured_deg", "predicted_deg")
    ]
    off = np.linalg.norm(tips[1] - tips[0], axis=2)
    assert list(answer["tips_mm"]) == ["index"]
    np.testing.assert_allclose(answer["tips_mm"]["index"], off[:, 1], atol=1e-9)
    assert np.abs(off[:, [0, 2, 3, 4]]).max() < 1e-9
    assert f"{off[:, 1].max():.1f} mm apart (index, " in answer["sentence"]


def test_the_whole_take_replayed_has_the_fingertip_error_of_the_comparison(trained: Trained) -> None:
    asked = {"take": trained.takes[0], "from_s": 0.0, "to_s": 60.0, "frames": 1200}
    answer = trained.client.post(f"/models/{trained.model}/replay", asked)
    right = fingertip_errors(Residuals(trained.found.rotations, trained.found.takes[:1]), {})
    assert right is not None
    known = np.array(answer["tips_mm"]["index"], float)
    assert np.sqrt(np.nanmean(known**2)) == pytest.approx(right.overall.rmse_mm, rel=0.02)


@pytest.mark.parametrize("route", ["series", "residual", "replay"])
def test_what_cannot_be_compared_is_refused_with_a_sentence(trained: Trained, route: str) -> None:
    client, path = trained.client, f"/models/{trained.model}/{route}"

    def body(take: str) -> dict:
        if route == "replay":
            return {"take": take, "from_s": 0.0, "to_s": 1.0}
        return {"takes": [take], "rotation": "I_PIP"}

    with pytest.raises(Refused, match="has layout 'other', not 'finger'"):
        client.post(path, body("take2"))
    with pytest.raises(Refused, match="has no take 'never'"):
        client.post(path, body("never"))
    if route == "replay":
        with pytest.raises(Refused, match="is no stretch of it"):
            client.post(path, {"take": trained.takes[0], "from_s": 70.0, "to_s": 71.0})
    else:
        with pytest.raises(Refused, match="T_IP"):
            client.post(path, {"takes": trained.takes, "rotation": "T_IP"})
    if route == "residual":
        with pytest.raises(Refused, match="no column 'moon'; there are angle, speed"):
            client.post(path, body(trained.takes[0]) | {"column": "moon"})


def test_a_bad_stretch_says_which_of_the_takes_it_is_in(trained: Trained) -> None:
    found = trained.client.post(f"/models/{trained.model}/where", {"takes": trained.takes})["stretches"]
    names = [item.take.name for item in trained.found.takes]
    assert [names[one["number"]] for one in found] == [one["take"] for one in found]
