"""Takes that are wrong are told of before an effect is named, with a command that runs as printed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cli_running import Run

from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes

FINGERS = ("I_PIP", "M_PIP", "R_PIP")


def bent(seed: int, gain: float = 17.0) -> Take:
    """10 s at 30 Hz of three flex sensors."""
    random = np.random.default_rng(seed)
    time = np.arange(300) / 30
    waves = np.sin(time[:, None, None] * [1.1, 2.3] + random.uniform(0, 6, (3, 2))).sum(axis=2)
    angles = 45 + 18 * waves + 0.4 * random.normal(size=waves.shape)
    readings = np.round(900 + gain * angles + 12 * random.normal(size=angles.shape))
    return Take("bending", "w", FINGERS, time, readings, FINGERS, time, angles)


def wrapped(take: Take) -> Take:
    return replace(take, reference=np.mod(take.reference + 140 + 180, 360) - 180)


def wild(take: Take) -> Take:
    reference = take.reference.copy()
    reference[20::83] += 120.0
    return replace(take, reference=reference)


def reversed_sensors(take: Take) -> Take:
    return replace(take, readings=take.readings[:, ::-1])


@pytest.fixture
def diagnosed(run: Run, tmp_path: Path) -> Callable[..., tuple[list[str], str, str, str]]:
    """Ids of four takes of one name, what import and training say, and the diagnosis."""

    def through(*changes: Callable[[Take], Take]) -> tuple[list[str], str, str, str]:
        said, ids = "", list[str]()
        for number in range(4):
            change = changes[number % len(changes)]
            [path] = write_takes([change(bent(number))], tmp_path / f"{number}.csv")
            imported = run("take", "import", path, "-s", "anna", "--json")
            said, ids = said + imported.said, [*ids, imported.json[0]["id"]]
        trained = run("train", "--subject", "anna", "--method", "linear")
        assert trained.code == 0, trained.err
        [model] = run("model", "list", "--json").json
        assert model["held_out_rmse_deg"] < 3.0 or len(changes) > 1
        return ids, said, trained.out + trained.err, run("diagnose", model["id"]).out

    return through


def test_a_reference_on_a_circle_is_told_and_spoils_nothing(run, diagnosed):
    ids, said, _, diagnosis = diagnosed(wrapped)
    assert "I_PIP steps by a full turn" in said
    assert "sensor_fault" not in diagnosis.partition("What was tried")[0]
    exported = run("take", "check", ids[0], "--json").json
    spans = [item["high_deg"] - item["low_deg"] for item in exported["rotations"]]
    assert max(spans) < 100


def test_wild_angles_are_told_by_take_with_times_and_spoil_nothing(run, diagnosed, tmp_path):
    ids, said, trained, diagnosis = diagnosed(wild)
    for text in (said, " ".join(trained.split()), " ".join(diagnosis.split())):
        assert "reference angles jump away and back" in text
        assert "at 0.67" in text
    jumps = run("take", "check", ids[1], "--json").json["jumps"]
    found = {(item["rotation"], round(item["start_s"], 2)) for item in jumps}
    assert found >= {("I_PIP", 0.67), ("R_PIP", 3.43)}
    assert "reference jumps" in run("take", "check", ids[1]).out
    assert run("take", "export", ids[1], tmp_path / "back.csv").code == 0
    [back] = read_takes(tmp_path / "back.csv")
    np.testing.assert_allclose(back.reference, wild(bent(1)).reference, err_msg="what was recorded is kept")


def test_a_take_of_other_columns_is_named_and_the_next_command_runs(run, diagnosed):
    ids, _, trained, diagnosis = diagnosed(*[lambda take: take] * 3, reversed_sensors)
    assert "I_PIP and R_PIP are exchanged" in " ".join(trained.split())
    assert "I_PIP and R_PIP are exchanged" in diagnosis
    assert "cross_coupling on" not in diagnosis
    [told] = [line for line in diagnosis.splitlines() if line.startswith("Next: ")]
    command = told.removeprefix("Next: glovecal ")
    assert command == f"train --subject anna --method linear --leave-out {ids[3]}"
    assert run(*command.split()).code == 0
    newest = max(run("model", "list", "--json").json, key=lambda model: model["created_at"])
    assert newest["held_out_rmse_deg"] < 3.0


def test_a_take_of_another_person_is_told_with_the_model_that_fits_it(run, tmp_path):
    for subject, gain, numbers in (("ben", 30.0, range(10, 13)), ("anna", 17.0, range(4))):
        takes = [bent(number, gain if number != 3 else 30.0) for number in numbers]
        for number, take in enumerate(takes):
            write_takes([take], tmp_path / f"{subject}-{number}.csv")
            assert run("take", "import", tmp_path / f"{subject}-{number}.csv", "-s", subject).code == 0
        assert run("train", "--subject", subject, "--method", "linear").code == 0
    ids = {item["subject"]: item["id"] for item in run("model", "list", "--json").json}
    [odd] = run("diagnose", ids["anna"], "--json").json["odd_takes"]
    assert odd["how"] == "another subject"
    assert f"ben's model {ids['ben'][:12]} fits it" in odd["sentence"]
