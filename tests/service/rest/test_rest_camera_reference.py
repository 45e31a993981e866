"""A camera as the reference over REST and on the command line: attached, trained from, compared,
diagnosed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulated_camera import CALIBRATED

from glovecal_client.rest import Refused, RestClient
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.camera_estimates import write_estimates
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.write_table import write_takes
from glovecal_service.cli.take.takes import camera
from glovecal_service.rest.in_process import in_process_client
from glovecal_service.settings import Settings

SENSORS = ("I_MCP", "I_PIP")
LAYOUT = 'name = "two"\nsensors = ["I_MCP", "I_PIP"]\n[rotations]\nI_MCP = ["I_MCP"]\nI_PIP = ["I_PIP"]\n'


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[RestClient, list[str], Path]]:
    """A client, three takes without reference angles, and a folder with the estimates of each."""
    folder = tmp_path_factory.mktemp("camera")
    plan = SessionPlan(seed=4, sensors=SENSORS, wearings=1, takes_per_wearing=3, take_s=25.0)
    session = record_session(plan)
    bare = [
        replace(take, rotations=(), reference_time_s=np.empty(0), reference=np.empty((0, 0)))
        for take in session.takes
    ]
    write_takes(bare, folder / "takes.csv")
    for number, (take, truth) in enumerate(zip(session.takes, session.truth, strict=True)):
        seen = replace(CALIBRATED, offset_s=0.25).see(take.time_s, truth, take.sensors, number)
        write_estimates(seen, folder / f"{number}.npz")
    with in_process_client(Settings(data=folder / "data")) as client:
        client.post("/subjects", {"name": "anna"})
        (folder / "two.toml").write_text(LAYOUT, encoding="utf-8")
        client.add_layout(folder / "two.toml")
        ids = client.upload_takes(folder / "takes.csv", subject="anna", layout="two")["imported"]
        yield client, ids, folder


@pytest.fixture(scope="module")
def attached(recorded: tuple[RestClient, list[str], Path]) -> list[dict[str, Any]]:
    client, ids, folder = recorded
    return [client.attach_camera_reference(id, folder / f"{number}.npz") for number, id in enumerate(ids)]


def test_the_answer_tells_clock_ranges_and_what_was_kept(recorded, attached, tmp_path: Path):
    client, ids, _ = recorded
    for answer in attached:
        assert answer["clock_offset_s"] == pytest.approx(0.25, abs=0.02)
        assert 0 < answer["clock_offset_sd_s"] < 0.02
        assert 0 < answer["accepted_share"] < 1
        assert {item["rotation"] for item in answer["camera_ranges"]} == set(SENSORS)
        assert "clock is" in answer["sentences"][0]
    take = client.get(f"/takes/{ids[0]}")
    assert take["facts"]["camera_reference"]["clock_offset_s"] == attached[0]["clock_offset_s"]
    assert "camera_patches" in take["context"]
    assert take["teaches"]
    for part in ("frames", "reference"):
        query = {"format": "csv", "part": part}
        (tmp_path / f"x.{part}.csv").write_bytes(client.download(f"/takes/{ids[0]}/export", query))
    (back,) = read_takes(tmp_path / "x.frames.csv")
    assert back.reference_sd is not None
    assert np.isfinite(back.reference_sd).any()


def test_train_compare_and_diagnose_say_what_is_the_cameras(recorded, attached):
    client, ids, _ = recorded
    body = {"subject": "anna", "layout": "two", "method": "linear", "takes": ids[:2], "folds": 0}
    result = client.wait_for_job(client.post("/models/train", body)["id"])["result"]
    assert [item["rotation"] for item in result["camera_ranges"]] == list(SENSORS)
    assert any("A camera measured 2 rotations" in sentence for sentence in result["sentences"])
    found = client.post(f"/models/{result['model']}/compare", {"takes": ids[2:]})
    assert any("the camera accounts for" in sentence for sentence in found["sentences"])
    assert any("other angles are not judged" in sentence for sentence in found["sentences"])
    floor = found["rotations"]["I_PIP"]["floor"]
    assert floor["reference_deg"] > 0.5
    assert floor["how"] == "stated" or floor["floor_deg"] >= floor["reference_deg"]
    job = client.post(f"/models/{result['model']}/diagnose", {"takes": ids})
    told = client.wait_for_job(job["id"])["result"]
    assert [item["rotation"] for item in told["camera_ranges"]] == list(SENSORS)
    assert any("other angles are not judged" in sentence for sentence in told["sentences"])


def test_what_cannot_be_a_reference_is_refused_and_changes_nothing(recorded, attached, tmp_path: Path):
    client, ids, folder = recorded
    before = client.get(f"/takes/{ids[0]}")
    (tmp_path / "half.npz").write_bytes((folder / "0.npz").read_bytes()[:500])
    with pytest.raises(Refused, match=r"half\.npz is no whole file"):
        client.attach_camera_reference(ids[0], tmp_path / "half.npz")
    with pytest.raises(Refused, match="camera's clock was not found"):
        client.attach_camera_reference(ids[0], folder / "1.npz")
    with pytest.raises(Refused, match=r"clock was not found within 0\.1 s of 2 s"):
        client.attach_camera_reference(ids[0], folder / "0.npz", near_s=2.0, within_s=0.1)
    assert client.get(f"/takes/{ids[0]}") == before


def test_what_was_simulated_is_no_reference_of_a_recorded_take(recorded, tmp_path: Path):
    client, _, folder = recorded
    text = (folder / "takes.csv").read_text(encoding="utf-8").splitlines()
    column = text[0].split(",").index("c.simulated")
    rows = [",".join(cell for place, cell in enumerate(row.split(",")) if place != column) for row in text]
    name = text[0].split(",").index("take")
    first = [
        rows[0],
        *(row for row, old in zip(rows[1:], text[1:], strict=True) if old.split(",")[name] == "w1-t1"),
    ]
    (tmp_path / "real.csv").write_text("\n".join(first) + "\n", encoding="utf-8")
    client.post("/subjects", {"name": "ben"})
    (take,) = client.upload_takes(tmp_path / "real.csv", subject="ben", layout="two")["imported"]
    with pytest.raises(Refused, match="was simulated or rendered"):
        client.attach_camera_reference(take, folder / "0.npz")


def test_the_command_line_prints_the_same_sentences(recorded, attached, monkeypatch, capsys):
    client, _, folder = recorded
    monkeypatch.setattr("glovecal_service.cli.take.takes.connect", lambda: _Open(client))
    camera(recorded[1][0], folder / "0.npz")
    said = " ".join(capsys.readouterr().out.split())
    assert said == " ".join(" ".join(attached[0]["sentences"]).split())


class _Open:
    """A client that stays open."""

    def __init__(self, client: RestClient) -> None:
        self._client = client

    def __enter__(self) -> RestClient:
        return self._client

    def __exit__(self, *_: object) -> None:
        return None
