"""Where a model fails, and the report page, over REST."""

from __future__ import annotations

from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from glovecal_client.rest import Refused, RestClient
from glovecal_service.rest.in_process import in_process_client
from glovecal_service.settings import Settings

VOID = {"meta", "br", "path", "use", "rect", "circle", "image"}


class Outline(HTMLParser):
    """Counts elements, and notices any that reach outside the page."""

    def __init__(self) -> None:
        super().__init__()
        self.count: dict[str, int] = {}
        self.outside: list[str] = []
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.count[tag] = self.count.get(tag, 0) + 1
        links = [value or "" for name, value in attrs if name in ("src", "href", "xlink:href")]
        self.outside += [link for link in links if not link.startswith(("#", "data:"))]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag


@pytest.fixture(scope="module")
def glove(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[RestClient, str, list[str]]]:
    """A client, a linear model of one joint that its neighbour pulls at, and two takes it has not seen."""
    folder = tmp_path_factory.mktemp("where")
    with in_process_client(Settings(data=folder / "data")) as client:
        client.post("/subjects", {"name": "anna"})
        layout = folder / "two.toml"
        layout.write_text('name = "two"\nsensors = ["A", "B"]\n[rotations]\nA = ["A"]\n')
        client.add_layout(layout)
        takes = [_take(client, folder, number) for number in range(3)]
        body = {"subject": "anna", "layout": "two", "method": "linear", "takes": takes[:1], "folds": 0}
        job = client.wait_for_job(client.post("/models/train", body)["id"])
        yield client, job["result"]["model"], takes


def _take(client: RestClient, folder: Path, number: int) -> str:
    generator = np.random.default_rng(number)
    time = np.arange(1800) / 60
    angle = 40 + 30 * np.sin(2 * np.pi * time / 7.3 + number)
    other = 30 * np.sin(2 * np.pi * time / 4.1 + 2 * number) if number else np.zeros(1800)
    sensor = 100 + angle + 0.2 * other + 0.3 * generator.normal(size=1800)
    file = folder / f"take{number}.csv"
    columns = np.column_stack([time, sensor, 100 + other, angle])
    np.savetxt(file, columns, delimiter=",", header="time_s,s.A,s.B,r.A", comments="", fmt="%.6f")
    return client.upload_takes(file, subject="anna", layout="two")["takes"][0]["id"]


def test_the_neighbour_is_named(glove: tuple[RestClient, str, list[str]]) -> None:
    client, model, takes = glove
    found = client.post(f"/models/{model}/where", {"takes": takes[1:]})
    [rotation] = found["rotations"]
    assert rotation["dependences"][0]["covariate"] == "sensor B"
    assert rotation["dependences"][0]["is_structure"] is True
    assert rotation["floor"]["floor_deg"] < 0.6 < rotation["rmse_deg"]
    assert "the reading of sensor B" in rotation["sentence"]
    assert len(found["stretches"]) == 5
    assert found["trained_on"] == []
    floors = [rotation["floor"], *rotation["other_floors"]]
    assert {"spectrum", "frame to frame"} <= {floor["how"] for floor in floors}
    assert rotation["slow"]["low"] < rotation["slow"]["share"] < rotation["slow"]["high"]
    assert client.post(f"/models/{model}/where", {"takes": takes})["trained_on"] == takes[:1]


def test_the_report_is_one_whole_page(glove: tuple[RestClient, str, list[str]]) -> None:
    client, model, takes = glove
    page = client.page(f"/models/{model}/report", {"takes": takes})
    outline = Outline()
    outline.feed(page)
    assert outline.open == []
    assert outline.outside == []
    assert "script" not in outline.count
    assert outline.count["svg"] == outline.count["figure"] == outline.count["figcaption"] == 6
    assert "the reading of sensor B" in page
    assert "p = 0.001: significant" in page
    assert "was trained on 1 of these takes" in page
    assert "simulated" not in page


def test_numbers_come_with_their_scales(glove: tuple[RestClient, str, list[str]]) -> None:
    client, model, takes = glove
    errors = client.post(f"/models/{model}/compare", {"takes": takes[1:]})["rotations"]["A"]
    assert errors["floor"]["floor_deg"] < errors["rmse_deg"] < errors["baseline_deg"]
    assert errors["floor"]["how"] == "still joint"
    assert errors["nlpd"] > np.log(errors["rmse_deg"]) + 1.41  # it claims to know better than it does


def test_models_stand_side_by_side_in_one_report(
    tmp_path: Path, glove: tuple[RestClient, str, list[str]]
) -> None:
    client, model, takes = glove
    body = {"subject": "anna", "layout": "two", "method": "raw", "takes": takes[:1], "folds": 0}
    raw = client.wait_for_job(client.post("/models/train", body)["id"])["result"]["model"]
    asked = {"takes": takes[1:], "beside": [raw[:8], model]}
    page = client.page(f"/models/{model}/report", asked)
    outline = Outline()
    outline.feed(page)
    assert outline.count["svg"] == outline.count["figcaption"] == 7
    assert "Models side by side" in page
    rmse = {f"raw {raw[:6]}": 0.0, f"linear {model[:6]}": 0.0}
    for name, id in zip(rmse, (raw, model), strict=True):
        rmse[name] = client.post(f"/models/{id}/compare", {"takes": takes[1:]})["overall"]["rmse_deg"]
    best, other = sorted(rmse, key=lambda name: rmse[name])
    assert f"{best} has the smallest error, {rmse[best]:.2f} degrees" in page
    assert f"({rmse[other]:.2f} for {other})" in page
    with pytest.raises(Refused, match="beside"):
        client.page(f"/models/{model}/report", asked | {"beside": ["no model"]})
    with pytest.raises(Refused, match="000000"):
        client.page(f"/models/{model}/report", asked | {"beside": ["000000"]})


def test_names_cannot_become_markup(tmp_path: Path, glove: tuple[RestClient, str, list[str]]) -> None:
    client, model, _ = glove
    file = tmp_path / "odd.csv"
    rows = [f"{i / 60},<b>x</b>&,{100 + i},{90 + i % 9},{i}" for i in range(90)]
    file.write_text("\n".join(["time_s,pose,s.A,s.B,r.A", *rows]))
    [take] = client.upload_takes(file, subject="anna", layout="two")["takes"]
    page = client.page(f"/models/{model}/report", {"takes": [take["id"]]})
    assert "<b>x</b>" not in page
    assert "&lt;b&gt;x&lt;/b&gt;&amp;" in page


def test_no_reference_is_refused(tmp_path: Path, glove: tuple[RestClient, str, list[str]]) -> None:
    client, model, _ = glove
    file = tmp_path / "bare.csv"
    file.write_text("time_s,s.A,s.B\n0,1,2\n0.1,2,3\n0.2,3,4\n")
    [take] = client.upload_takes(file, subject="anna", layout="two")["takes"]
    for verb in ("where", "report", "compare"):
        with pytest.raises(Refused, match="none of the takes measured a rotation"):
            client.post(f"/models/{model}/{verb}", {"takes": [take["id"]]})
