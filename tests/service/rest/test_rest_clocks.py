"""Reference clocks over REST: found, repaired in place, undone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from glovecal_client.rest import Refused, RestClient


def imported(client: RestClient, folder: Path, name: str, offset_s: float) -> str:
    """A take whose reference clock is ahead by ``offset_s``."""
    generator = np.random.default_rng(len(name))
    time = np.arange(600) / 60
    motion = np.cumsum(generator.normal(size=700))
    angle = np.interp(np.arange(600) + 50, np.arange(700), np.convolve(motion, np.ones(40) / 8, "same"))
    frames, reference = folder / f"{name}.frames.csv", folder / f"{name}.reference.csv"
    sensor = 100 + angle + 0.1 * generator.normal(size=600)
    np.savetxt(frames, np.c_[time, sensor], delimiter=",", header="time_s,s.A", comments="")
    np.savetxt(reference, np.c_[time + offset_s, angle], delimiter=",", header="time_s,r.A", comments="")
    [take] = client.upload_takes(frames, subject="anna", layout="one", reference=reference)["takes"]
    return take["id"]


@pytest.fixture
def subject(client: RestClient, tmp_path: Path) -> RestClient:
    client.post("/subjects", {"name": "anna"})
    layout = tmp_path / "one.toml"
    layout.write_text('name = "one"\nsensors = ["A"]\n[rotations]\nA = ["A"]\n')
    client.add_layout(layout)
    return client


def test_found_repaired_and_undone(subject: RestClient, tmp_path: Path) -> None:
    off = imported(subject, tmp_path, "off", 0.7)
    right = imported(subject, tmp_path, "right", 0.0)
    looked = subject.post("/takes/clocks", {"takes": [off, right]})
    assert [item["verdict"] for item in looked] == ["offset", "agrees"]
    assert looked[0]["offset_s"] == pytest.approx(0.7, abs=0.02)
    assert "0.70 s ahead of the glove" in looked[0]["sentence"]
    assert "clock_offset_s" not in subject.get(f"/takes/{off}")["facts"]

    repaired = subject.post("/takes/clocks", {"takes": [off, right], "repair": True})
    assert [item["repaired"] for item in repaired] == [True, False]
    assert subject.get(f"/takes/{off}")["facts"]["clock_offset_s"] == pytest.approx(0.7, abs=0.02)
    [again] = subject.post("/takes/clocks", {"takes": [off], "repair": True})
    assert (again["verdict"], again["repaired"]) == ("agrees", False)

    assert subject.post("/takes/clocks/undo", {"takes": [off, right]}) == [off]
    assert subject.post("/takes/clocks/undo", {"takes": [off]}) == []
    [back] = subject.post("/takes/clocks", {"takes": [off]})
    assert back["offset_s"] == pytest.approx(looked[0]["offset_s"], abs=1e-6)


def test_what_cannot_be_judged_stays(subject: RestClient, tmp_path: Path) -> None:
    file = tmp_path / "bare.csv"
    file.write_text("time_s,s.A\n0,1\n1,2\n2,3\n")
    [take] = subject.upload_takes(file, subject="anna", layout="one")["takes"]
    [clock] = subject.post("/takes/clocks", {"takes": [take["id"]], "repair": True})
    assert (clock["verdict"], clock["repaired"]) == ("not identifiable", False)
    with pytest.raises(Refused) as refused:
        subject.post("/takes/clocks", {"takes": ["0123456789ab"]})
    assert refused.value.status == 404
