"""Programs in C++ and Rust, written from wire/README.md, read what we write."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

GOLDEN = Path(__file__).parent / "golden"
MESSAGES = ("frame_v1", "pose_v1", "pose_v1_faulty", "pose_v1_settling")


@pytest.fixture(scope="module", params=["read_messages.cpp", "read_messages.rs"])
def reader(request: pytest.FixtureRequest, compiled: Callable[[Path], Path]) -> Path:
    return compiled(GOLDEN / request.param)


@pytest.mark.parametrize("name", MESSAGES)
def test_golden_messages_are_read_in_another_language(reader: Path, name: str) -> None:
    read = subprocess.run([reader, GOLDEN / f"{name}.bin"], capture_output=True, check=True)
    assert json.loads(read.stdout) == json.loads((GOLDEN / f"{name}.json").read_text())


@pytest.mark.parametrize("name", ["frame_v1", "pose_v1"])
def test_damage_is_refused_in_another_language_too(reader: Path, tmp_path: Path, name: str) -> None:
    message = (GOLDEN / f"{name}.bin").read_bytes()
    path = tmp_path / "message"
    for damaged in (b"", message[:-1], message + b"\0", message[:60] + b"\x99" + message[61:]):
        path.write_bytes(damaged)
        assert subprocess.run([reader, path], capture_output=True, check=False).returncode == 1
