"""ARCHITECTURE.md names what is there, and every package says in its first line what it is for."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MAP = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
PATHS = sorted(set(re.findall(r"`((?:models|client|service|tests)/[\w./-]+)`", MAP)))
TOPS = ("models/glovecal", "models/glovecal_models", "client/glovecal_client", "service/glovecal_service")
PACKAGES = [path.parent for top in TOPS for path in sorted((ROOT / top).rglob("__init__.py"))]
MOST_SIBLINGS = 16
"""Packages at one level: about a dozen."""


@pytest.mark.parametrize("path", PATHS)
def test_what_the_map_names_is_there(path: str) -> None:
    assert (ROOT / path).exists()


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_package_says_what_it_is_for(package: Path) -> None:
    said = ast.get_docstring(ast.parse((package / "__init__.py").read_text(encoding="utf-8")))
    assert said, "an __init__.py begins with what the package is for"
    assert said.splitlines()[0].rstrip().endswith((".", ":")) or ":" in said.splitlines()[0]
    siblings = [child for child in package.iterdir() if (child / "__init__.py").is_file()]
    assert len(siblings) <= MOST_SIBLINGS


def test_every_room_of_the_mathematics_is_on_the_map() -> None:
    rooms = {child.name for child in (ROOT / "models/glovecal_models").iterdir() if child.is_dir()}
    rooms -= {"__pycache__", "layouts"}
    assert {room for room in rooms if f"`{room}`" not in MAP} == set()
