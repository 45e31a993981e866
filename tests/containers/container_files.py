"""What of the container files can be looked at without building them."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

DOCKERFILES = ("service.Dockerfile", "capture.Dockerfile")
BASE = "python:3.11-slim-bookworm"


def problems(root: Path) -> list[str]:
    """Sentences; none when all is well. ``root`` is a checkout with the environment that do.py makes."""
    found = list(_schema_problems(root / "docker" / "compose.yaml"))
    for name in DOCKERFILES:
        text = (root / "docker" / name).read_text(encoding="utf-8")
        found += [f"{name}: {problem}" for problem in _file_problems(root, text)]
        found += [f"{name}: {problem}" for problem in _sync_problems(root, text)]
    return found


def health_check(text: str) -> list[str]:
    """The command with which the engine asks; empty without one."""
    found = re.search(r"^HEALTHCHECK .*?CMD[\s\\]+\[(.*?)\]", text, re.MULTILINE | re.DOTALL)
    return re.findall(r'"(.*?)"', found[1]) if found else []


def _schema_problems(compose: Path) -> Iterator[str]:
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", "vendor.compose-spec"]
    checked = subprocess.run([*command, str(compose)], capture_output=True, text=True)
    if checked.returncode:
        yield f"{compose.name} is no Compose file: {checked.stdout}{checked.stderr}".strip()


def _file_problems(root: Path, text: str) -> Iterator[str]:
    """Bases, copied files and the health check's module."""
    if f"ARG BASE={BASE}\n" not in text or set(re.findall(r"^FROM (\S+)", text, re.MULTILINE)) != {"$BASE"}:
        yield f"both stages are to start from {BASE}, by BASE"
    for line in re.findall(r"^COPY (?!--from)(.+)$", text, re.MULTILINE):
        for source in line.split()[:-1]:
            if not (root / source).exists():
                yield f"COPY names {source}, which is not there"
    asked = health_check(text)
    if asked and (asked[:3] != ["python", "-P", "-m"] or find_spec(asked[3]) is None):
        yield f"HEALTHCHECK runs {shlex.join(asked)}, which is no module of ours"


def _sync_problems(root: Path, text: str) -> Iterator[str]:
    """Whether the lock has what the first uv sync asks for (its wheels: tests/verbs/test_lock.py)."""
    uv = [str(root / ".tools" / "bin" / "uv"), *_first_sync(text), "--dry-run", "--offline", "--quiet"]
    asked = subprocess.run([*uv, "--python", sys.executable], cwd=root, capture_output=True, text=True)
    if asked.returncode:
        yield f"cannot be built: {asked.stderr.strip()}"


def _first_sync(text: str) -> list[str]:
    [extras] = re.findall(r'^ARG EXTRAS="(.*)"', text, re.MULTILINE) or [""]
    command = text.partition("RUN uv ")[2].partition(" && ")[0].partition("\nCOPY")[0]
    filled = re.sub(r"\$\(printf .*?\)", " ".join(f"--extra {name}" for name in extras.split()), command)
    return shlex.split(filled.replace("\\\n", " "))
