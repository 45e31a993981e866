"""A walk through the command line in one process: import, train, compare, activate, roll back, export."""

from __future__ import annotations

import hashlib
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from cli_running import glovecal

from glovecal_models.calibration.artifact import load
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.takes.table import read_takes


@pytest.fixture(scope="module")
def walked(tmp_path_factory, tables: Path):
    """A data folder with a linear model and a raw one (active) of ``anna``; take ``second`` is left out."""
    run = partial(glovecal, {"GLOVECAL_DATA": str(tmp_path_factory.mktemp("walk") / "data")})
    assert run("subject", "add", "anna").code == 0
    files = (tables / "train.csv", tables / "test.frames.csv", tables / "test.reference.csv")
    assert run("take", "import", *files, "-s", "anna").code == 0
    linear = run("train", "-s", "anna", "--method", "linear", "--leave-out", "second", "--folds", 2)
    assert linear.code == 0, linear.err
    raw = run("train", "-s", "anna", "--method", "raw", "-t", "poses", "-t", "cross", "--folds", 0, "--json")
    return run, linear, raw.json


def by_method(run) -> dict[str, dict]:
    return {row["method"]: row for row in run("model", "list", "--json").json}


def test_training_says_what_it_did(walked):
    run, linear, raw = walked
    models = by_method(run)
    assert set(models) == {"linear", "raw"}
    id = models["linear"]["id"]
    lines = linear.out.splitlines()
    assert lines[1].startswith(f"Model {id[:12]} (linear) for anna, held-out error ")
    assert lines[1].endswith("Active.")
    assert lines[2].startswith("In a wearing not seen: unknown")
    assert "2 takes" in linear.err
    assert "PALM_ARCH" in linear.err
    assert raw["model"]["id"] == models["raw"]["id"] == raw["result"]["model"]
    assert raw["model"]["active"]
    assert raw["model"]["held_out_rmse_deg"] is None
    trained = [take["name"] for take in raw["model"]["facts"]["takes"]]
    assert trained == ["poses", "cross"]
    assert {job["state"] for job in run("job", "list", "--json").json} == {"done"}


def test_models_are_compared_side_by_side_on_takes_they_have_not_seen(walked):
    run, _, _ = walked
    models = by_method(run)
    ids = [models[method]["id"] for method in ("raw", "linear")]
    results = run("compare", *ids, "--json").json
    assert list(results) == ids
    raw, linear = (results[id]["overall"]["rmse_deg"] for id in ids)
    assert linear < 0.7 * raw
    beside = run("compare", *(id[:6] for id in ids))
    assert beside.out.splitlines()[0] == "Against second:"
    everywhere = next(line.split() for line in beside.out.splitlines() if line.startswith("all"))
    assert everywhere[1:3] == [f"{raw:.2f}", f"{linear:.2f}"]
    assert "Careful" not in beside.said
    floors = [results[id]["overall"]["floor"] for id in ids]
    floor = min(floors, key=lambda one: (one["is_lower_bound"], one["floor_deg"]))
    interval = f"{floor['low_deg']:.2f}-{floor['high_deg']:.2f}"
    assert everywhere[3].rstrip("?") == (
        f">{floor['floor_deg']:.2f}" if floor["is_lower_bound"] else interval
    )
    tips = [results[id]["fingertips"]["overall"]["rmse_mm"] for id in ids]
    assert tips[1] < 0.7 * tips[0]
    in_mm = beside.out[beside.out.index("fingertip RMSE (mm)") :].splitlines()
    assert in_mm[1].split()[:3] == ["all", f"{tips[0]:.2f}", f"{tips[1]:.2f}"]
    one = run("compare", ids[1], "--poses", "--take", "second")
    assert "\nthumb to index" in one.out
    assert results[ids[1]]["fingertips"]["sentence"] in one.out
    assert "glovecal subject measure anna --hand-length-mm LENGTH" in one.out
    assert "fist" in one.out
    heads = next(line.split() for line in one.out.splitlines() if line.startswith("rotation"))
    assert heads[:4] == ["rotation", "RMSE", "floor", "mean"]
    assert "NLPD" in one.out
    assert (
        max(len(line) for line in one.out.splitlines() if not line.endswith((".", ")", ":"))) <= 80
    )  # the tables
    seen = run("compare", ids[1], "-t", "poses", "-t", "second", "-t", "poses")
    assert "\nTakes: poses, second\n" in seen.out
    careful = f"Careful, not a held-out error: linear {ids[1][:6]} was trained on 1 of these takes (poses)."
    assert careful in seen.out


def test_a_page_with_both_models_is_written_beside_the_json(walked, tmp_path):
    run, _, _ = walked
    models = by_method(run)
    page = tmp_path / "both.html"
    answer = run("compare", *(models[m]["id"] for m in ("linear", "raw")), "--report", page, "--json")
    assert list(answer.json) == [models[m]["id"] for m in ("linear", "raw")]
    assert f"Wrote {page}" in answer.err
    assert "Models side by side" in page.read_text()
    assert "exists already" in run("compare", models["raw"]["id"], "--report", page).said


def test_a_recording_is_compared_with_both_directions_of_time(walked, tmp_path):
    run, _, _ = walked
    id, page = by_method(run)["linear"]["id"], tmp_path / "offline.html"
    live, offline = (run("compare", id, *more, "--json").json[id] for more in ((), ("--offline",)))
    assert live["live"] is None
    assert offline["live"]["rmse_deg"] == live["overall"]["rmse_deg"] != offline["overall"]["rmse_deg"]
    told = run("compare", id, "--offline", "--report", page)
    sentence = (
        f"with both directions of time: {offline['overall']['rmse_deg']:.2f} degrees, "
        f"live {live['overall']['rmse_deg']:.2f}; with a delay of 0 ms "
    )
    assert [one["delay_ms"] for one in offline["delayed"]] == [0, 50, 100, 200]
    for text in (told.out, page.read_text()):
        assert sentence in " ".join(text.split())
        assert f"200 ms {offline['delayed'][-1]['rmse_deg']:.2f}." in " ".join(text.split())
    assert "What a delay would buy" in page.read_text()


def test_comparing_agrees_with_the_exported_model(walked, tables, tmp_path):
    """The artifact read back in Python, its prediction held against the take's file by hand."""
    run, _, _ = walked
    id = by_method(run)["linear"]["id"]
    file = tmp_path / "anna.safetensors"
    exported = run("model", "export", id[:8], file)
    assert exported.out == f"Wrote {file}.\n"
    assert "artifact.load" in exported.err
    content = file.read_bytes()
    assert hashlib.sha256(content).hexdigest() == id
    predictor = GlovePredictor(load(content))
    (take,) = read_takes(tables / "test.frames.csv", tables / "test.reference.csv")
    angles = predictor.predict(take.readings)
    measured = take.reference_at_frames(take.rotations)
    for rotation in ("I_MCP", "T_VIR"):
        errors = (
            angles.mean[:, predictor.rotations.index(rotation)] - measured[:, take.rotations.index(rotation)]
        )
        told = run("compare", id, "--json").json[id]["rotations"][rotation]
        assert told["rmse_deg"] == pytest.approx(np.sqrt(np.nanmean(errors**2)), rel=1e-9)
    assert "exists already" in run("model", "export", id, file).said
    assert run("model", "export", id, file, "--overwrite").code == 0


def test_show_tells_takes_and_lineage(walked):
    run, _, _ = walked
    id = by_method(run)["linear"]["id"]
    shown = run("model", "show", id, "--json").json
    assert shown["lineage"] == [id]
    assert len(shown["rotations"]) == 22
    read = run("model", "show", id[:6]).out
    assert "poses, cross" in read
    assert "T_VIR" in read
    about = run("subject", "show", "anna").out
    assert "models" in about
    listed = run("model", "list", "-s", "anna", "-l", "cyberglove18").out.splitlines()
    assert len(listed) == 3
    assert max(map(len, listed)) <= 80
    assert "No models yet" in run("model", "list", "-l", "lucidglove").out


def test_activate_and_roll_back(walked):
    run, _, _ = walked
    models = by_method(run)
    raw, linear = models["raw"]["id"], models["linear"]["id"]
    assert run("model", "activate", linear).out == f"Model {linear[:12]} is active for anna, cyberglove18.\n"
    assert by_method(run)["linear"]["active"]
    assert run("model", "rollback", "-s", "anna").out.startswith(f"Model {raw[:12]} is active again")
    assert run("model", "rollback", "-s", "anna").out.startswith(f"Model {linear[:12]} is active again")
    ended = run("model", "rollback", "-s", "anna", "-l", "cyberglove18")
    assert ended.code == 1
    assert "nothing earlier was active" in ended.said
    assert by_method(run)["linear"]["active"]


def test_a_damaged_active_model_is_told_by_list_and_show(walked):
    run, *_ = walked
    [active] = [row["id"] for row in run("model", "list", "--json").json if row["active"]]
    file = Path(run.args[0]["GLOVECAL_DATA"]) / "artifacts" / active
    content = file.read_bytes()
    file.write_bytes(content[:-1])
    try:
        shown, listed = run("model", "show", active[:12]), run("model", "list")  # which finds it at once
    finally:
        file.write_bytes(content)
    assert f"Damaged: model {active[:12]} cannot be loaded" in listed.said
    assert shown.code == 1
    assert "or train again: glovecal train --subject anna" in shown.said


def test_what_models_stand_on_stays(walked):
    run, _, _ = walked
    assert "was trained on take" in run("take", "remove", "cross").said
    assert "still owns" in run("subject", "remove", "anna").said
    everything = run(
        "train", "-s", "anna", "--leave-out", "poses", "--leave-out", "cross", "--leave-out", "second"
    )
    assert everything.code == 1
    assert "besides those left out" in everything.said
    assert run("job", "cancel", run("job", "list", "--json").json[0]["id"]).out.endswith(" is done.\n")


def test_nothing_is_left_to_compare_with(run, tables):
    """A model trained on all takes is not held against them unasked."""
    run("subject", "add", "ben")
    assert run("take", "import", tables / "other.parquet", "-s", "ben").code == 0
    trained = run("train", "-s", "ben", "--method", "raw", "--folds", 0, "--no-activate")
    assert "no cross-validation. Not active." in trained.out
    (model,) = run("model", "list", "--json").json
    refused = run("compare", model["id"])
    assert refused.code == 1
    assert "--leave-out" in refused.said
