"""Makes the data folder that tests find stored, by the command line and from simulated takes.

Made anew only where a version may forget what those before it stored; from a release on it stays, and later
versions read it: ``python tests/service/stored_example/make_example.py``, beside it ``expected.json``.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tarfile
import tempfile
from os import environ
from pathlib import Path
from typing import Any

import numpy as np

from glovecal_models.calibration import artifact
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.write_table import write_takes

HERE = Path(__file__).parent
PLAN = SessionPlan(
    seed=7, sensors=("I_MCP", "I_PIP"), rate_hz=20.0, wearings=3, takes_per_wearing=3, take_s=12.0
)
CAUSES = (
    Cause("hysteresis", "several_plays", 3.0),
    Cause("donning_shift", "offset", 3.0),
    Cause("cross_coupling", None, 3.0, ("I_MCP",)),
)
EVERY_SO_MANY = 40
"""Frames between those whose poses are kept."""


def main() -> None:
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made) / "data"
        folder.mkdir()
        *takes, unseen = record_session(PLAN, CAUSES).takes
        write_takes(takes, Path(made) / "takes.csv")
        write_takes([unseen], folder / "unseen.csv")
        expected = _walk(folder, Path(made) / "takes.csv")
        (HERE / "expected.json").write_text(json.dumps(expected) + "\n", encoding="utf-8")
        with tarfile.open(HERE / "data.tar.xz", "w:xz") as packed:
            for name in ("artifacts", "uploads", "glovecal.sqlite3", "unseen.csv"):
                packed.add(folder / name, f"data/{name}", filter=_whoever_made_it)


def _walk(folder: Path, table: Path) -> dict[str, Any]:
    """Calibrations, effects, an improvement and a diagnosis, as a person would ask for them."""

    def run(*words: str) -> Any:
        command = [sys.executable, "-m", "glovecal_service.cli.command", *words, "--json"]
        surroundings = {**environ, "GLOVECAL_DATA": str(folder)}
        done = subprocess.run(command, env=surroundings, capture_output=True, text=True, check=False)
        assert done.returncode == 0, (words, done.stdout, done.stderr)
        return json.loads(done.stdout)

    run("take", "import", str(table), "--subject", "anna")
    first = run("train", "--subject", "anna", "--samples", "200")["model"]["id"]
    active = run("add-effect", first, "hysteresis", "--activate")["model"]
    run("add-effect", active, "donning_shift")
    line = run("train", "--subject", "anna", "--method", "linear", "--no-activate")["model"]["id"]
    squeeze = "columns = I_PIP, I_PIP * own; unit = deg"
    run("add-effect", line, "squeeze", "--rotation", "I_MCP", "--expression", squeeze)
    run("improve", "--subject", "anna", "--method", "linear", "--no-ceiling")
    run("diagnose", active)
    models = {row["id"]: {name: row[name] for name in ("effects", "active")} for row in run("model", "list")}
    return {
        "active": active,
        "models": models,
        "jobs": [row["id"] for row in run("job", "list")],
        "predicted": {name: _predicted(folder, name) for name in models},
    }


def _predicted(folder: Path, name: str) -> dict[str, Any]:
    model = artifact.load((folder / "artifacts" / name).read_bytes())
    [take] = read_takes(folder / "unseen.csv")
    readings = take.readings[:, [take.sensors.index(sensor) for sensor in model.layout.sensors]]
    angles = GlovePredictor(model).predict_take(take.time_s, readings, take.context, take.wearing)
    parts = {"mean_deg": angles.mean, "sd_deg": angles.sd}
    return {part: np.round(values[::EVERY_SO_MANY], 9).tolist() for part, values in parts.items()}


def _whoever_made_it(member: tarfile.TarInfo) -> tarfile.TarInfo:
    member.uid = member.gid = 0
    member.uname = member.gname = "root"
    return member


if __name__ == "__main__":
    main()
