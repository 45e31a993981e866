"""``glovecal train --people``: other people's takes as a prior, from the store or a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cli_running import Run

from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes

SENSORS = ("I_MCP", "I_PIP")
PEOPLE = ("anna", "bert", "cleo", "dora")


def takes_of(person: int, wearings: int, seconds: float) -> list[Take]:
    """Two sensors about two joints, each take of another part of their range."""
    random = np.random.default_rng(person)
    gains, offset = np.array([0.5, 0.2]) + 0.03 * random.standard_normal(2), 5 * random.standard_normal()
    takes = []
    for number in range(wearings):
        shift = 3 * random.standard_normal()
        for part in range(2):
            time_s = np.arange(0, seconds, 0.05)
            swing = np.sin(2 * np.pi * time_s[:, None] / 3 + np.array([0, 2.0 * part]))
            readings = np.round(
                150 + 40 * part + np.array([60, 20]) * swing + random.normal(0, 0.5, swing.shape)
            )
            angles = (readings - 150) @ gains + offset + shift + random.normal(0, 3, len(time_s))
            name = f"{part}-{number}"
            takes.append(
                Take(name, f"day-{number}", SENSORS, time_s, readings, ("BEND",), time_s, angles[:, None])
            )
    return takes


@pytest.fixture
def with_people(run: Run, tmp_path: Path) -> Run:
    for number, person in enumerate(PEOPLE):
        bring_in(run, tmp_path, person, takes_of(number, 2, 8.0))
    bring_in(run, tmp_path, "new", takes_of(20, 1, 4.0))
    return run


def bring_in(run: Run, folder: Path, person: str, takes: list[Take]) -> None:
    files = [folder / f"{person}-{take.name}.csv" for take in takes]
    for file, take in zip(files, takes, strict=True):
        write_takes([take], file)
    answer = run("take", "import", *files, "-s", person)
    assert answer.code == 0, answer.err


def test_a_new_person_leans_on_those_of_the_layout_and_is_told_what_that_was_worth(
    with_people: Run, tmp_path: Path
) -> None:
    run = with_people
    answer = run("train", "-s", "new", "--method", "linear", "--people")
    assert answer.code == 0, answer.err
    assert "Its prior is the takes of 4 other people; error without:" in answer.out
    result = run("train", "-s", "new", "--method", "linear", "--people", "--json").json["result"]
    assert result["people"] == 4
    assert result["held_out_rmse_deg"] < result["alone_rmse_deg"]
    layout = run("take", "list", "--json").json[0]["layout"]
    file = tmp_path / "prior.json"
    assert run("glove", "people", layout, file).code == 0
    assert not any(person in file.read_text() for person in (*PEOPLE, "day-"))
    from_file = run("train", "-s", "new", "--method", "linear", "--people-file", file, "--json").json[
        "result"
    ]
    assert from_file["people"] == 5
    file.write_text(file.read_text().replace('"people": 5', '"people": 6', 1))
    refused = run("train", "-s", "new", "--method", "linear", "--people-file", file)
    assert refused.code != 0
    assert "was changed after it was written" in refused.err


def test_what_cannot_lean_on_people_is_refused_with_the_remedy(with_people: Run) -> None:
    refused = with_people("train", "-s", "new", "--people")
    assert refused.code != 0
    assert "--method linear" in refused.err
    absent = with_people("train", "-s", "new", "--method", "linear", "--people", "--for-wearing", "day-7")
    assert absent.code != 0
    assert "name a wearing of the takes" in absent.err
    earlier = with_people("train", "-s", "anna", "--method", "linear", "--people", "--for-wearing", "day-1")
    assert earlier.code == 0, earlier.err
