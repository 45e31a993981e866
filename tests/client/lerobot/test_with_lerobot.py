"""LeRobot 0.4.4 itself, in an environment of its own, finds the plug-in and is moved and stopped by it."""

# pyright: reportMissingImports=false

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest
from dataset_v3 import Episode, write_dataset
from loopback import free_endpoint
from published_poses import DEGREES, HOLD_S, Glove

from glovecal_client import open_router

ROOT = Path(__file__).resolve().parents[3]
PROGRAM, READER = (Path(__file__).with_name(name) for name in ("with_lerobot.py", "read_with_lerobot.py"))
UV = ROOT / ".tools" / "bin" / "uv"
LIGHT = (
    "draccus==0.10.0", "huggingface_hub<2", "numpy<2.3", "deepdiff", "pyserial", "tqdm", "packaging",
    "eclipse-zenoh>=1.10", "pandas", "datasets", "pyarrow",
)  # fmt: skip


@pytest.fixture(scope="module")
def python(
    tmp_path_factory: pytest.TempPathFactory,
    outside: Mapping[str, str],
    not_here: Callable[[str], NoReturn],
) -> Path:
    """With LeRobot, without what it learns with, and with the plug-in."""
    if sys.version_info >= (3, 12) or not UV.is_file():
        not_here("LeRobot 0.4.4 is tried with Python 3.11 and the uv of python3 do.py")
    folder = tmp_path_factory.mktemp("lerobot") / "environment"
    ours = [ROOT / "client", ROOT / "client" / "lerobot_teleoperator_glovecal"]
    python = folder / "bin" / "python"
    steps = [
        ["venv", "--python", sys.executable, folder],
        ["pip", "install", "--python", python, *LIGHT],
        ["pip", "install", "--python", python, "--no-deps", "lerobot==0.4.4", *ours],
    ]
    for step in steps:
        words = [str(UV), "--quiet", "--system-certs", *map(str, step)]
        done = subprocess.run(words, env=dict(outside), capture_output=True, text=True, timeout=300)
        if done.returncode:
            not_here(f"LeRobot cannot be installed here (uv {step[0]}): {done.stderr.strip()[-300:]}")
    return python


@pytest.fixture
def endpoint() -> Iterator[str]:
    endpoint = free_endpoint()
    with open_router([endpoint]):
        yield endpoint


def test_lerobots_own_loop_follows_and_stops(python: Path, endpoint: str, tmp_path: Path) -> None:
    glove = Glove(endpoint)
    try:
        command = [str(python), "-I", str(PROGRAM), endpoint, str(HOLD_S)]
        complaints = (tmp_path / "complaints").open("w+")
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=complaints, text=True, env={"HF_HOME": str(tmp_path)}
        )
        with process, complaints:
            begun, moved = told(process, tmp_path), told(process, tmp_path)
            glove.pose = None
            ended = told(process, tmp_path)
            process.wait(timeout=60)
            complaints.seek(0)
            assert process.returncode == 0, complaints.read()
    finally:
        glove.close()
    assert begun == {
        "type": "glovecal", "name": "glovecal", "calibrated": True, "features": ["index.pos", "middle.pos"],
    }  # fmt: skip
    assert moved["count"] > 10
    assert moved["last"] == {"index.pos": 80.0, "middle.pos": DEGREES[2]}, "90 degrees is above the limit"
    assert ended["kind"] == "GloveNotUsable"
    assert f"glove right stopped moving the robot after {HOLD_S:g} s: its pose is stale" in ended["why"]


def test_lerobots_own_functions_read_the_data_set(python: Path, tmp_path: Path) -> None:
    rng, names, folder = np.random.default_rng(0), ["a.pos", "b.pos"], tmp_path / "data set"
    first, second = (Episode(*rng.normal(size=(2, count, 2)).astype(np.float32)) for count in (5, 3))
    write_dataset(folder, [first, second], names=names, fps=20, task="wave", robot="hand")
    environment = {"HF_HOME": str(tmp_path / "hub"), "HF_HUB_OFFLINE": "1"}
    done = subprocess.run(
        [str(python), str(READER), str(folder)], env=environment, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    read = json.loads(done.stdout.splitlines()[-1])
    assert (read["version"], read["fps"], read["names"], read["tasks"]) == ("v3.0", 20, names, {"wave": 0})
    assert (folder / read["path"]).is_file()
    assert read["totals"] == [8, 2, 1]
    spans = [[each[f"dataset_{end}_index"] for end in ("from", "to")] for each in read["episodes"]]
    assert (spans, [each["length"] for each in read["episodes"]]) == ([[0, 5], [5, 8]], [5, 3])
    rows = read["rows"]
    actions = np.concatenate([first.actions, second.actions])
    states = np.concatenate([first.states, second.states])
    np.testing.assert_array_equal(np.float32(rows["action"]), actions)
    np.testing.assert_array_equal(np.float32(rows["observation.state"]), states)
    np.testing.assert_allclose(rows["timestamp"], [0, 0.05, 0.1, 0.15, 0.2, 0, 0.05, 0.1], atol=1e-7)
    assert (rows["index"], rows["episode_index"]) == (list(range(8)), [0] * 5 + [1] * 3)
    assert (rows["frame_index"], rows["task_index"]) == ([0, 1, 2, 3, 4, 0, 1, 2], [0] * 8)
    np.testing.assert_allclose(read["action_mean"], actions.mean(axis=0), rtol=1e-5)
    np.testing.assert_allclose(read["state_q99"], np.quantile(states.astype(float), 0.99, axis=0), rtol=1e-6)


def told(process: subprocess.Popen[str], folder: Path) -> dict:
    """The next line that is JSON; LeRobot prints between them."""
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith("{"):
            return json.loads(line)
    raise AssertionError(f"it ended with {process.wait()}: {(folder / 'complaints').read_text()[-2000:]}")
