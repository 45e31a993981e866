"""Programs in C++ and Rust, written from wire/README.md, read what we write."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import pytest

GOLDEN = Path(__file__).parent / "golden"
MESSAGES = ("frame_v1", "pose_v1", "pose_v1_faulty", "pose_v1_settling")


@dataclass(frozen=True)
class Language:
    source: str
    compilers: tuple[str, ...]
    options: tuple[str, ...]
    remedy: str


LANGUAGES = {
    "C++": Language(
        "read_messages.cpp", ("c++", "g++", "clang++"), ("-std=c++17", "-Wall", "-Wextra", "-Werror"),
        "apt-get install g++",
    ),
    "Rust": Language(
        "read_messages.rs", ("rustc",), ("--edition", "2021", "-D", "warnings"), "apt-get install rustc"
    ),
}  # fmt: skip


@pytest.fixture(scope="module", params=LANGUAGES)
def reader(
    request: pytest.FixtureRequest,
    tmp_path_factory: pytest.TempPathFactory,
    not_here: Callable[[str], NoReturn],
    outside: Mapping[str, str],
) -> Path:
    language = LANGUAGES[request.param]
    compiler = next(filter(None, map(shutil.which, language.compilers)), None)
    if compiler is None:
        not_here(f"there is no {request.param} compiler (Debian: {language.remedy})")
    program = tmp_path_factory.mktemp("reader") / "read_messages"
    command = [compiler, *language.options, "-o", str(program), str(GOLDEN / language.source)]
    subprocess.run(command, check=True, env=dict(outside))
    return program


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
