"""What people say of takes: a stretch left out is worked around and undone, a note found; hands in parts."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glovecal_client.rest import Refused, RestClient
from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes
from glovecal_service.questions.model_work import ModelWork
from glovecal_service.settings import Settings
from glovecal_service.store import Store

HZ, SECONDS = 100.0, 40.0
WRONG = (10.0, 16.0)
"""Where the reference of the spoiled take is another joint's."""


def bending(name: str, phase: float, *, wrong: bool = False) -> Take:
    time = 5.0 + np.arange(int(SECONDS * HZ)) / HZ
    angle = 45.0 + 40.0 * np.sin(1.1 * time + phase)
    reference = angle.copy()
    if wrong:
        inside = (time >= 5.0 + WRONG[0]) & (time <= 5.0 + WRONG[1])
        reference[inside] = 45.0 + 20.0 * np.sin(1.7 * time[inside])
    counts = np.round(400.0 + 5.0 * angle)[:, None]
    return Take(name, "w1", ("I_PIP",), time, counts, ("I_PIP",), time, reference[:, None])


@pytest.fixture
def takes(client: RestClient, tmp_path: Path) -> list[dict[str, Any]]:
    client.post("/subjects", {"name": "anna"})
    [file] = write_takes([bending("good", 0.0), bending("spoiled", 1.0, wrong=True)], tmp_path / "two.csv")
    return client.upload_takes(file, subject="anna")["takes"]


@pytest.fixture
def stored(settings: Settings, client: RestClient) -> Iterator[Store]:
    with Store.open(settings) as store:
        yield store


def linear(client: RestClient, takes: list[str] | None = None) -> dict[str, Any]:
    asked = {"subject": "anna", "method": "linear", "folds": 0, "takes": takes}
    job = client.post("/models/train", asked)
    trained = client.wait_for_job(job["id"])["result"]["model"]
    return client.get(f"/models/{trained}")


def error(client: RestClient, model: dict[str, Any], take: str) -> float:
    """RMSE in degrees."""
    return client.post(f"/models/{model['id']}/compare", {"takes": [take]})["overall"]["rmse_deg"]


def test_it_is_marked_undone_and_nothing_stored_of_the_take_changes(
    client: RestClient, takes: list[dict[str, Any]], stored: Store
) -> None:
    id = takes[1]["id"]
    before = client.download(f"/takes/{id}/export")
    first = client.post(f"/takes/{id}/left-out", {"from_s": 10.0, "to_s": 16.0})
    assert first["left_out"] == [[10.0, 16.0]]
    both = client.post(f"/takes/{id}/left-out", {"from_s": 35.0, "to_s": 99.0})
    assert both["left_out"] == [[10.0, 16.0], [35.0, pytest.approx(39.99)]]
    assert client.get(f"/takes/{id}/series")["left_out"] == both["left_out"]
    assert (both["artifact"], both["frames"]) == (takes[1]["artifact"], takes[1]["frames"])
    assert client.download(f"/takes/{id}/export") == before
    assert len(stored.takes.load_recorded(id).time_s) == SECONDS * HZ
    assert len(stored.takes.load(id).time_s) == pytest.approx(SECONDS * HZ - 1100, abs=3)
    check = client.get(f"/takes/{id}/check")
    assert check["gaps"] == 0
    assert client.post(f"/takes/{id}/left-out/undo", {})["left_out"] == [[10.0, 16.0]]
    again = client.post(f"/takes/{id}/left-out/undo", {"stretch": {"from_s": 10.001, "to_s": 16.0}})
    assert again["left_out"] == []
    with pytest.raises(Refused, match="nothing to undo"):
        client.post(f"/takes/{id}/left-out/undo", {})


def test_training_sees_the_rest_and_says_so(client: RestClient, takes: list[dict[str, Any]]) -> None:
    id = takes[1]["id"]
    spoiled = linear(client)
    client.post(f"/takes/{id}/left-out", {"from_s": WRONG[0], "to_s": WRONG[1]})
    clean = linear(client)
    assert error(client, spoiled, takes[0]["id"]) > 1.0
    assert error(client, clean, takes[0]["id"]) < 0.2
    assert clean["facts"]["takes"][1]["left_out"] == [[10.0, 16.0]]
    assert "Take 'spoiled': left out by hand: 10.00 to 16.00 s." in clean["facts"]["sentences"]
    assert error(client, clean, id) < 0.2
    client.post(f"/takes/{id}/left-out/undo", {})
    assert error(client, clean, id) > 5.0


def test_a_job_on_a_take_with_another_stretch_left_out_is_another_job(
    client: RestClient, takes: list[dict[str, Any]], stored: Store
) -> None:
    """Finished parts of jobs are used again where nothing changed that decides them."""
    id = takes[1]["id"]
    model = stored.models.get(linear(client)["id"])

    def identity() -> dict[str, Any]:
        return ModelWork.of(stored, model, [stored.takes.get(id)]).identity

    whole = identity()
    client.post(f"/takes/{id}/left-out", {"from_s": WRONG[0], "to_s": WRONG[1]})
    assert identity() != whole
    client.post(f"/takes/{id}/left-out/undo", {})
    assert identity() == whole


@pytest.mark.parametrize(
    ("stretch", "said"),
    [
        ((3.0, 3.0), "no stretch of take 'good', which lasts 39.99 s"),
        ((5.0, 2.0), "the earlier one first"),
        ((-1.0, 2.0), "no stretch"),
        ((41.0, 42.0), "no stretch"),
        ((0.0, 40.0), "no frame of take 'good' would be left"),
    ],
)
def test_what_is_no_stretch_or_leaves_nothing_is_refused(
    client: RestClient, takes: list[dict[str, Any]], stretch: tuple[float, float], said: str
) -> None:
    with pytest.raises(Refused, match=said) as refused:
        client.post(f"/takes/{takes[0]['id']}/left-out", {"from_s": stretch[0], "to_s": stretch[1]})
    assert refused.value.status == 422
    assert client.get(f"/takes/{takes[0]['id']}")["left_out"] == []


def test_the_hand_comes_in_parts_of_bounded_size(client: RestClient, takes: list[dict[str, Any]]) -> None:
    id = takes[0]["id"]
    part = client.get(f"/takes/{id}/hand")
    assert (part["source"], part["names"], part["to_s"]) == ("reference", ["I_PIP"], 30.0)
    last = client.get(f"/takes/{id}/hand", {"from_s": part["to_s"]})
    for each in (part, last):
        assert np.diff(each["time_s"]).min() > 1 / 60
    assert last["to_s"] == pytest.approx(39.99)
    angle = 45.0 + 40.0 * np.sin(1.1 * (5.0 + np.array(last["time_s"])))
    assert np.array(last["values"])[:, 0] == pytest.approx(angle, abs=0.01)
    with pytest.raises(Refused, match="give a from_s inside it"):
        client.get(f"/takes/{id}/hand", {"from_s": 50})


def test_the_hand_of_a_take_that_was_not_measured(
    client: RestClient, takes: list[dict[str, Any]], tmp_path: Path
) -> None:
    model = linear(client, [takes[0]["id"]])["id"]
    good = bending("bare", 2.0)
    bare = Take("bare", "w1", good.sensors, good.time_s, good.readings)
    [file] = write_takes([bare], tmp_path / "bare.csv")
    [take] = client.upload_takes(file, subject="anna", layout=takes[0]["layout"])["takes"]
    raw = client.get(f"/takes/{take['id']}/hand")
    assert (raw["source"], raw["names"], raw["spans"]) == ("raw", ["I_PIP"], [[425.0, 825.0]])
    assert raw["values"][0] == [good.readings[0, 0]]
    posed = client.get(f"/takes/{take['id']}/hand", {"model": model[:12], "from_s": 20})
    assert (posed["source"], posed["model"]) == ("model", model)
    at = 5.0 + np.array(posed["time_s"])
    assert np.array(posed["values"])[:, 0] == pytest.approx(45.0 + 40.0 * np.sin(1.1 * at + 2.0), abs=2.0)


def test_a_note_stays_with_its_take_and_is_found(client: RestClient, takes: list[dict[str, Any]]) -> None:
    path = f"/takes/{takes[1]['id']}"
    client.post(f"{path}/left-out", {"from_s": 1.0, "to_s": 2.0})
    kept = client.put(f"{path}/note", {"note": "cold room\r\nthumb slipped"})
    assert kept["note"].splitlines() == ["cold room", "thumb slipped"]
    assert kept["left_out"] == [[1.0, 2.0]]
    assert [take["id"] for take in client.get("/takes", {"text": "COLD"})] == [takes[1]["id"]]
    with pytest.raises(Refused):
        client.put(f"{path}/note", {"note": "x" * 2001})
    assert client.put(f"{path}/note", {"note": ""})["note"] == ""
