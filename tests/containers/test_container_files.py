"""The container files without building them; ``python3 do.py containers`` builds and runs them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest
from container_files import health_check, problems

ROOT = Path(__file__).resolve().parents[2]
SERVICE, COMPOSE = "docker/service.Dockerfile", "docker/compose.yaml"
STORE, OF_SITE = "docker/site/store.yaml", "docker/site/service.yaml"
PARTS = ("models", "client", "service")
CHANGES = (
    (COMPOSE, "restart:", "restarts:", "is no Compose file"),
    (STORE, "bookworm@sha256:", "bookworm@sha512:", "one image has several digests: postgres:15"),
    (SERVICE, "COPY client client", "COPY clients client", "COPY names clients, which is not there"),
    (SERVICE, '"glovecal_service.health_check"', '"glovecal_service.healthy"', "is no module of ours"),
    (SERVICE, "FROM $BASE\n", "FROM debian\n", "these do not: debian"),
    (SERVICE, "bookworm@sha256:", "bookworm@sha512:", "BASE is not pinned by its digest"),
    (SERVICE, "camera postgres", "camera-pictures postgres", "camera-pictures"),
)


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory, not_here: Callable[[str], NoReturn]) -> Path:
    """A copy of what the checks read."""
    if not (ROOT / ".tools" / "bin" / "uv").is_file():
        not_here("needs the environment that do.py makes")
    copy = tmp_path_factory.mktemp("checkout")
    shutil.copytree(ROOT / "docker", copy / "docker")
    for name in ("pyproject.toml", "uv.lock", *(f"{part}/pyproject.toml" for part in PARTS)):
        (copy / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, copy / name)
    (copy / ".tools").symlink_to(ROOT / ".tools")
    return copy


def test_they_are_right(checkout: Path) -> None:
    assert problems(checkout) == []


def test_what_is_wrong_in_them_is_told(checkout: Path, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong"
    shutil.copytree(checkout, wrong, symlinks=True)
    for file, right, mistake, _ in CHANGES:
        text = (wrong / file).read_text(encoding="utf-8")
        assert right in text
        (wrong / file).write_text(text.replace(right, mistake), encoding="utf-8")
    told = problems(wrong)
    for *_, said in CHANGES:
        assert any(said in problem for problem in told), said


def test_both_engines_ask_the_same(checkout: Path) -> None:
    """A Docker image carries its health check; Compose files name it again for images that do not."""
    asked = health_check((checkout / SERVICE).read_text(encoding="utf-8"))
    listed = ", ".join(f'"{word}"' for word in ["CMD", *asked])
    for file in (COMPOSE, OF_SITE):
        assert f"test: [{listed}]" in (checkout / file).read_text(encoding="utf-8")
