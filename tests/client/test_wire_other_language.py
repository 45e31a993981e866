"""A C++ program written from wire/README.md reads what we write."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest

GOLDEN = Path(__file__).parent / "golden"
COMPILER = shutil.which("c++") or shutil.which("g++") or shutil.which("clang++")


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory, not_here: Callable[[str], NoReturn]) -> Path:
    if COMPILER is None:
        not_here("there is no C++ compiler (Debian: apt-get install g++)")
    program = tmp_path_factory.mktemp("reader") / "read_messages"
    command = [COMPILER, "-std=c++17", "-Wall", "-Wextra", "-Werror", "-o", str(program)]
    subprocess.run([*command, str(GOLDEN / "read_messages.cpp")], check=True)
    return program


@pytest.mark.parametrize("name", ["frame_v1", "pose_v1"])
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
