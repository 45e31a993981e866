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
COMPOSE_FILES = ("compose.yaml", "site/service.yaml", "site/store.yaml")
PINNED = re.compile(r"[a-z0-9./-]+:[a-z0-9.-]+@sha256:[0-9a-f]{64}")


def base(root: Path) -> str:
    """What the images of a checkout start from: name, tag and, but for earlier ones, digest."""
    return _base((root / "docker" / DOCKERFILES[0]).read_text(encoding="utf-8"))


def problems(root: Path) -> list[str]:
    """Sentences; none when all is well. ``root`` is a checkout with the environment that do.py makes."""
    found = [problem for name in COMPOSE_FILES for problem in _schema_problems(root / "docker" / name)]
    found += _image_problems(root)
    for name in DOCKERFILES:
        text = (root / "docker" / name).read_text(encoding="utf-8")
        if _base(text) != base(root):
            found.append(f"{name} starts from another image than {DOCKERFILES[0]}")
        found += [f"{name}: {problem}" for problem in _file_problems(root, text)]
        found += [f"{name}: {problem}" for problem in _lock_problems(root, text)]
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


def _image_problems(root: Path) -> Iterator[str]:
    """Other people's images are pinned, each by one digest in all files."""
    texts = [(root / "docker" / name).read_text(encoding="utf-8") for name in COMPOSE_FILES]
    images = set(re.findall(r"^ +image: (?!glovecal-)(\S+)$", "\n".join(texts), re.MULTILINE))
    yield from (f"{image} is not pinned by its digest" for image in images if not PINNED.fullmatch(image))
    if len({image.partition("@")[0] for image in images}) < len(images):
        yield f"one image has several digests: {', '.join(sorted(images))}"


def _base(text: str) -> str:
    """ "" where there is none."""
    found = re.search(r"^ARG BASE=(\S+)$", text, re.MULTILINE)
    return found[1] if found else ""


def _file_problems(root: Path, text: str) -> Iterator[str]:
    """Bases, copied files and the health check's module."""
    if not PINNED.fullmatch(_base(text)):
        yield f"BASE is not pinned by its digest: {_base(text)!r}"
    stages = set(re.findall(r"^FROM \S+ AS (\S+)", text, re.MULTILINE))
    if others := set(re.findall(r"^FROM (\S+)", text, re.MULTILINE)) - {"$BASE", *stages}:
        yield f"every stage is to start from BASE, by one ARG; these do not: {', '.join(sorted(others))}"
    for line in re.findall(r"^COPY (?!--from)(.+)$", text, re.MULTILINE):
        for source in line.split()[:-1]:
            if not (root / source).exists():
                yield f"COPY names {source}, which is not there"
    asked = health_check(text)
    if asked and (asked[:3] != ["python", "-P", "-m"] or find_spec(asked[3]) is None):
        yield f"HEALTHCHECK runs {shlex.join(asked)}, which is no module of ours"


def _lock_problems(root: Path, text: str) -> Iterator[str]:
    """Whether the lock has what the image asks for (its wheels: tests/verbs/test_lock.py)."""
    uv = [str(root / ".tools" / "bin" / "uv"), *_export(text), "--offline", "--python", sys.executable]
    asked = subprocess.run(uv, cwd=root, capture_output=True, text=True)
    if asked.returncode:
        yield f"cannot be built: {asked.stderr.strip()}"


def _export(text: str) -> list[str]:
    """The command that lists other people's packages, without the file that it writes."""
    [extras] = re.findall(r'^ARG EXTRAS="(.*)"', text, re.MULTILINE) or [""]
    command = text.partition("RUN uv ")[2].partition("--output-file")[0]
    filled = re.sub(r"\$\(printf .*?\)", " ".join(f"--extra {name}" for name in extras.split()), command)
    return shlex.split(filled.replace("\\\n", " "))
