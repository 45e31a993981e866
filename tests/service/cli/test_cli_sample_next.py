"""``glovecal sample next`` and ``GET models/{id}/next-steps``: ranked proposals for a model that is there."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from cli_running import Answer, glovecal
from realtime_support import LAYOUT, linear_model

from glovecal_client.rest import Refused
from glovecal_models.calibration.artifact import dump
from glovecal_models.diagnosis.answer import MissingEffects
from glovecal_models.diagnosis.residual_answer import NextTake
from glovecal_models.simulation.protocol import free_segment, segments
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take
from glovecal_models.takes.write_table import write_takes
from glovecal_service.plain import document_of
from glovecal_service.rest.in_process import in_process_client
from glovecal_service.settings import Settings
from glovecal_service.store import Store


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """``anna`` with a linear model of one finger in key poses, and free motion; ``bert`` with nothing."""
    folder = tmp_path_factory.mktemp("next")
    glove = SimulatedGlove(1)
    poses = simulate_take(glove, segments("key_poses", 1), rate_hz=20, name="poses").take
    free = simulate_take(glove, free_segment(1, 12.0), rate_hz=20, name="free").take
    columns = [poses.rotations.index(name) for name in ("I_MCP", "I_PIP")]
    finger = replace(poses, rotations=("I_MCP", "I_PIP"), reference=poses.reference[:, columns])
    nothing = np.empty(0)
    mute = replace(free, rotations=(), reference_time_s=nothing, reference=np.empty((0, 0)))
    write_takes([finger], folder / "poses.csv")
    write_takes([mute], folder / "free.csv")
    run = partial(glovecal, {"GLOVECAL_DATA": str(folder / "data")})
    for name in ("anna", "bert"):
        assert run("subject", "add", name).code == 0
    for name in ("poses", "free"):
        imported = run("take", "import", folder / f"{name}.csv", "-s", "anna", "--layout", "cyberglove18")
        assert imported.code == 0, imported.err
    trained = run("train", "--subject", "anna", "--method", "linear")
    assert trained.code == 0, trained.err
    return folder


def run(folder: Path, *arguments: object) -> Answer:
    return glovecal({"GLOVECAL_DATA": str(folder / "data"), "COLUMNS": "160"}, "sample", "next", *arguments)


def test_the_steps_are_ranked_with_what_is_expected_of_them(folder: Path) -> None:
    found = run(folder, "-s", "anna", "--most", "3", "--json").json
    assert len(found["steps"]) == 3
    assert (found["diagnosed"], found["enough"]) == (None, False)
    first = found["steps"][0]
    assert first["rms_sd_after_deg"] < found["rms_sd_deg"]
    assert all(first["sd_after_deg"][name] < found["sd_deg"][name] for name in first["angles"])
    assert "T_IP" in found["assumed"]
    shown = run(folder, "-s", "anna", "--most", "3")
    assert shown.code == 0, shown.err
    assert first["name"] in shown.out
    assert f"Next: {first['name']}. Expected standard deviation in degrees: " in shown.out
    assert "Assumed, not learned: how far " in shown.out


def test_what_a_diagnosis_asks_for_stands_beside_it(folder: Path) -> None:
    model = run(folder, "-s", "anna", "--json").json["model"]
    wanted = NextTake("fast", "Swing fast.", 25, ("lag", "clock_offset"), "fast")
    found = MissingEffects({}, None, (), (), None, wanted, (), model=model)
    with Store.open(Settings(data=folder / "data")) as store:
        store.jobs.create("diagnose", {"model": model}, subject="anna")
        job = store.jobs.claim("test")
        assert job is not None
        store.jobs.finish(job.id, job.attempt, document_of(found))
    assert run(folder, model[:8], "--json").json["diagnosed"]["separates"] == ["lag", "clock_offset"]
    assert "Also useful, 25 s: Swing fast. The diagnosis cannot tell" in run(folder, "-s", "anna").out


def test_without_a_model_or_its_takes_it_says_so(folder: Path) -> None:
    assert "subject bert has no active model" in run(folder, "-s", "bert").err
    assert run(folder).code == 2
    with in_process_client(Settings(data=folder / "data")) as client:
        with pytest.raises(Refused) as unknown:
            client.get("/models/abcdef123456/next-steps")
        assert unknown.value.status == 404
        with pytest.raises(Refused) as many:
            client.get("/models/abcdef123456/next-steps", {"most": 0})
        assert many.value.status == 422
    model = linear_model("bert", degrees_per_count=0.5)
    with Store.open(Settings(data=folder / "data")) as store:
        store.layouts.put(LAYOUT)
        kept = store.models.add(
            dump(model), subject="bert", layout=LAYOUT.name, method="linear", parent=None, facts={}
        )
    assert "was trained on are not stored" in run(folder, kept.id).err
