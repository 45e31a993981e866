"""The command line against a real service with a real simulated glove streaming over zenoh."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest
from cli_running import glovecal, simulated, start
from realtime_support import eventually, free_endpoint

from glovecal_models.takes.write_table import write_takes

GLOVE = "right-hand"
LIVE_PAGE = Path(__file__).parents[3] / "docs" / "live.md"


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """Settings with which every verb reaches a running ``glovecal serve``; subject ``anna`` is there."""
    folder, endpoint = tmp_path_factory.mktemp("live"), free_endpoint()
    port = free_endpoint().rpartition(":")[2]
    settings = {"GLOVECAL_DATA": str(folder / "data"), "GLOVECAL_ZENOH": endpoint, "GLOVECAL_PORT": port}
    process = start(settings, "serve")
    try:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("Glovecal is running")
        reach = {"GLOVECAL_URL": f"http://127.0.0.1:{port}", "GLOVECAL_ZENOH": endpoint}
        reach["GLOVECAL_DATA"] = str(folder / "capture")
        assert glovecal(reach, "subject", "add", "anna").code == 0
        yield reach
    finally:
        _, complaints = _end(process)
    assert process.returncode == 0
    assert "Traceback" not in complaints


def _end(process: subprocess.Popen[str]) -> tuple[str, str]:
    """As Ctrl-C does; what the process said."""
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
    try:
        return process.communicate(timeout=120)
    finally:
        process.kill()


@contextmanager
def streaming(live: dict[str, str], *options: str) -> Iterator[None]:
    """``glovecal capture`` of the simulated glove until the block ends; it must end cleanly."""
    arguments = [word for option in ("seed=1", *options) for word in ("--option", option)]
    arguments += ["--subject", "Anna", "--wearing", "monday"]
    process = start(live, "capture", "--device", "simulated", "--glove", GLOVE, *arguments)
    try:
        yield
    finally:
        said, complaints = _end(process)
    assert process.returncode == 0, complaints
    assert "Subject Anna is stored as anna." in complaints
    assert said.startswith("run ")
    assert "Traceback" not in complaints


def is_seen(run) -> bool:
    return any(glove["name"] == GLOVE for glove in run("glove", "list", "--json").json["seen"])


@pytest.fixture(scope="module")
def recorded(live: dict[str, str], tmp_path_factory) -> Path:
    """Take ``first`` of three seconds, recorded by ``glovecal record``; its reference file."""
    reference = tmp_path_factory.mktemp("reference") / "first.csv"
    run = partial(glovecal, live)
    with streaming(live, "motion=key_poses", f"reference={reference}"):
        eventually(lambda: is_seen(run), "the service sees the glove")
        done = run("record", GLOVE, "first", "--seconds", 3, "--json").json
    assert done["state"] == "done"
    assert done["facts"]["recorded"] == done["facts"]["sent"] > 200
    assert done["facts"]["missing"] == []
    return reference


def test_a_recorded_take_becomes_a_model_that_predicts_live(live, recorded):
    run = partial(glovecal, live)
    (take,) = run("take", "list", "--json").json
    assert (take["name"], take["subject"], take["wearing"]) == ("first", "anna", "monday")
    assert "no reference angles" in run("train", "-s", "anna", "-t", "first").said
    attached = run("take", "reference", "first", recorded)
    assert attached.code == 0, attached.err
    assert re.search(r"; (9\d|100) % of its frames", attached.out), "fewer where the computer stood still"
    begun = run("train", "-s", "anna", "--method", "linear", "--folds", 0, "--no-wait", "--json").json
    assert run("job", "wait", begun["id"], "--json").json["state"] == "done"
    assert run("job", "wait", begun["id"]).out == f"Job {begun['id']} is done.\n"
    (model,) = run("model", "list", "--json").json
    assert model["active"]

    with streaming(live, "motion=free"):
        poses: list[dict] = []

        def is_calibrated() -> bool:
            answer = run("watch", GLOVE, "--json", "--seconds", 0.5)
            told = [json.loads(line) for line in answer.out.splitlines()]
            poses[:] = [pose for pose in told if "stale" not in pose["state"]]  # or of the recording before
            return bool(poses) and poses[-1]["model"] == model["id"]

        eventually(is_calibrated, "poses of the new model")
        assert len(poses[-1]["degrees"]) == len(poses[-1]["sd_deg"]) == 22
        assert "simulated" in poses[-1]["state"]
        sequence = [pose["sequence"] for pose in poses]
        assert sequence == sorted(set(sequence))
        drawn = run("watch", GLOVE, "--seconds", 0.3)
        assert drawn.out.startswith(f"{GLOVE}: ")
        assert f"model {model['id'][:12]}" in drawn.out
        assert "I_MCP" in drawn.out
        assert re.search(
            r"^frames: sent \d+, received \d+, missing \d+, predicted \d+", drawn.out, re.MULTILINE
        )
        frames = poses[-1]["frames"]
        assert frames["sent"] == frames["received"] + frames["missing"]
        assert frames["predicted"] > 0
        _run_the_documented_subscriber(live)
        _watch_until_interrupted(live)
        _record_with_pre_roll(live)
        assert "worn by nobody" in run("glove", "wear", GLOVE, "--nobody").out
        eventually(lambda: "no model is active" in run("watch", GLOVE, "--seconds", 0.2).out, "nobody's pose")
        assert f"nobody wears glove {GLOVE}" in run("watch", GLOVE, "--seconds", 0.3).out.replace("\n", " ")
    silent = run("watch", "left-hand", "--seconds", 0.3, "--json")
    assert (silent.code, silent.out) == (1, "")
    assert "no pose of glove left-hand received" in silent.said


def _run_the_documented_subscriber(live: dict[str, str]) -> None:
    """As it stands there, but for the address and the glove's name."""
    (code,) = re.findall("```python\n(.*?)```", LIVE_PAGE.read_text(), re.DOTALL)
    code = code.replace("tcp/127.0.0.1:7447", live["GLOVECAL_ZENOH"]).replace('"right"', f'"{GLOVE}"')
    process = subprocess.Popen([sys.executable, "-u", "-c", code], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
    finally:
        process.kill()
        process.communicate()
    assert re.match(r"\d+ \(.*'simulated'.*\) \{'T_TMC': -?\d", line), line


def _record_with_pre_roll(live: dict[str, str]) -> None:
    """The glove streams for seconds already: the take begins before it was asked for."""
    run = partial(glovecal, live)
    said = run("record", GLOVE, "second", "--seconds", 0.3, "--pre-roll", 0.5).out
    assert re.search(r"Pre-roll: 0\.[45] of the 0\.5 s before it \(\d+ frames\)\.", said)
    assert re.search(r"pre-roll +\d+ of them in 0\.[45]", run("take", "check", "second").out)
    assert "pre-roll" in run("record", GLOVE, "x", "--pre-roll", 601).said.lower()


def _watch_until_interrupted(live: dict[str, str]) -> None:
    """Ctrl-C is how one stops watching: exit code 0, whole lines."""
    process = start(live, "watch", GLOVE, "--json")
    assert process.stdout is not None
    assert json.loads(process.stdout.readline())["degrees"]
    said, complaints = _end(process)
    assert (process.returncode, complaints) == (0, "")
    assert all(json.loads(line) for line in said.splitlines())


def test_a_replayed_file_is_predicted_by_the_model_trained_on_its_columns(live, tmp_path):
    """Own columns, and a file name that is no layout's: what counts is the sensors."""
    run = partial(glovecal, live)
    rows = ["time_s,take,wearing,s.bend_a,s.bend_b,r.I_MCP"]
    for frame in range(240):
        a, b = 500 + 300 * math.sin(frame / 9), 400 + 200 * math.cos(frame / 13)
        rows.append(f"{frame / 60:.4f},t{frame // 120},monday,{a:.3f},{b:.3f},{0.1 * a - 20:.3f}")
    file = tmp_path / "Own Columns.frames.csv"
    file.write_text("\n".join(rows) + "\n")
    assert run("subject", "add", "cleo").code == 0
    assert run("take", "import", file, "-s", "cleo").code == 0
    trained = run("train", "-s", "cleo", "--method", "linear", "--folds", 0)
    assert trained.code == 0, trained.err
    (model,) = run("model", "list", "-s", "cleo", "--json").json
    capture = ["capture", "--device", f"replay:{file}", "--glove", "replayed", "--option", "loop=yes"]
    process = start(live, *capture, "--subject", "cleo")
    try:

        def calibrated() -> dict | None:
            told = run("watch", "replayed", "--json", "--seconds", 0.5).out.splitlines()
            poses = [pose for line in told if (pose := json.loads(line))["model"] == model["id"]]
            return poses[-1] if poses else None

        pose = eventually(calibrated, "poses of the model")
        assert -1.0 < pose["degrees"]["I_MCP"] < 61.0
        done = run("record", "replayed", "again", "--seconds", 0.3, "--json").json
        assert done["state"] == "done"
        takes = {take["name"]: take for take in run("take", "list", "-s", "cleo", "--json").json}
        assert takes["again"]["layout"] == takes["t0"]["layout"] == model["layout"]
    finally:
        _, complaints = _end(process)
    assert f"poses: calibrated; model {model['id'][:12]}" in complaints


def test_a_job_is_cancelled(live, tables):
    run = partial(glovecal, live)
    run("subject", "add", "ben")
    assert run("take", "import", tables / "train.csv", "-s", "ben").code == 0
    begun = run("train", "-s", "ben", "--folds", 5, "--no-wait")
    job = begun.out.split()[1]
    assert f"glovecal job wait {job}" in begun.out
    assert run("job", "cancel", job).out in (f"Job {job} is being cancelled.\n", f"Job {job} is cancelled.\n")
    waited = run("job", "wait", job)
    assert (waited.code, waited.out) == (1, "")
    assert f"job {job} cancelled" in waited.said
    assert run("job", "cancel", job).out == f"Job {job} is cancelled.\n"
    assert "cancelled" in run("job", "list").out
    assert run("model", "list", "-s", "ben", "--json").json == []


def test_interrupted_training_leaves_nothing(anna_of_its_own):
    """The job is cancelled, the workers are gone, nothing but a sentence is said."""
    settings = anna_of_its_own
    process = start(settings, "train", "-s", "anna")
    eventually(lambda: len(_session(process.pid)) > 3, "workers have started")
    time.sleep(1.0)
    said, complaints = _end(process)
    assert process.returncode == 130
    assert said == ""
    assert complaints.endswith("cancelled; finished parts are kept for the next attempt.\n")
    assert len(complaints.splitlines()) == 1
    eventually(lambda: not _session(process.pid), "no process is left")
    (job,) = glovecal(settings, "job", "list", "--json").json
    assert job["state"] == "cancelled"


@pytest.fixture
def anna_of_its_own(tmp_path, tables) -> dict[str, str]:
    settings = {"GLOVECAL_DATA": str(tmp_path / "data")}
    assert glovecal(settings, "subject", "add", "anna").code == 0
    assert glovecal(settings, "take", "import", tables / "train.csv", "-s", "anna").code == 0
    return settings


def _session(leader: int) -> list[int]:
    """Processes alive in a session."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            if entry.name.isdecimal() and os.getsid(int(entry.name)) == leader:
                state = (entry / "stat").read_text().rpartition(")")[2].split()[0]
                found += [int(entry.name)] * (state != "Z")
        except OSError:
            continue
    return found


def test_a_worn_glove_is_examined(live, tmp_path):
    """A stuck sensor and a missing model are told, each with what to do, and the exit code is for scripts."""
    run = partial(glovecal, live)
    nobody = run("doctor", "nobody")
    assert nobody.code == 4
    assert nobody.out.startswith("capture: Nothing is heard of glove nobody at site lab.")
    take = simulated("evaluation", "worn")
    readings = take.readings.copy()
    readings[:, take.sensors.index("R_PIP")] = 97
    file = tmp_path / "worn.csv"
    write_takes([dataclasses.replace(take, readings=readings)], file)
    capture = ["capture", "--device", f"replay:{file}", "--glove", "examined", "--option", "loop=yes"]
    process = start(live, *capture, "--subject", "dora")
    try:
        eventually(lambda: run("watch", "examined", "--seconds", 1).code == 0, "poses come")
        answer = run("doctor", "examined", "--json")
        told = run("doctor", "examined")
    finally:
        _end(process)
    assert (answer.code, told.code) == (4, 4)
    document = json.loads(answer.out)
    assert document["frames"] > 50
    parts = [one["part"] for one in document["findings"] if one["part"] != "cable"]  # a busy computer's gaps
    assert parts == ["sensor", "model"]
    said = " ".join(told.out.split())
    assert "sensor: R_PIP is always 97 while other sensors move. Look at its strip" in said
    assert "model: dora, who wears examined, is no subject yet." in told.out
