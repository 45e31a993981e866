"""The client's wheel in an empty environment: numpy and eclipse-zenoh are all it brings."""

import json
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = """
import numpy as np
from glovecal_client.wire.frame import Frame, decode_frame, encode_frame
import glovecal_client, glovecal_client.capture.command, glovecal_client.pose_subscriber
frame = Frame(1, 2, 3, 4, np.arange(18, dtype="<f4"))
assert decode_frame(encode_frame(frame)).readings.tolist() == list(range(18))
"""


def run(*command: str, **more: str) -> str:
    result = subprocess.run(command, capture_output=True, text=True, timeout=150, env={**os.environ, **more})
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_it_installs_with_numpy_and_zenoh_only(tmp_path: Path, not_here: Callable[[str], NoReturn]) -> None:
    tool = shutil.which("uv") or shutil.which("uv", path=str(ROOT / ".tools" / "bin"))
    if tool is None:
        not_here("needs uv, which python3 do.py installs")
    run(tool, "build", "--wheel", "--quiet", "--out-dir", str(tmp_path), str(ROOT / "client"))
    (wheel,) = tmp_path.glob("glovecal_client-*.whl")
    run(tool, "venv", "--quiet", str(tmp_path / "empty"))
    python = str(tmp_path / "empty" / "bin" / "python")
    run(tool, "pip", "install", "--quiet", "--python", python, str(wheel))
    listed = json.loads(run(tool, "pip", "list", "--python", python, "--format", "json"))
    assert {item["name"] for item in listed} == {"glovecal-client", "numpy", "eclipse-zenoh"}
    run(python, "-W", "error", "-c", PROGRAM, PYTHONPATH="")
