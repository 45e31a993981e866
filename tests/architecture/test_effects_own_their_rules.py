"""Outside ``effects`` nothing decides by an effect's name, imports one, or asks whether an object is one."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from glovecal_models.effects.catalogue import catalogue

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("models/glovecal_models", "client/glovecal_client", "service/glovecal_service")
OF_EFFECTS = (
    "models/glovecal_models/effects/",
    "models/glovecal_models/simulation/causes/",
    "service/glovecal_service/demo/",
)
OPEN = ("glovecal_models.effects.base.", "glovecal_models.effects.catalogue")
"""What anybody may import: the machinery, and the catalogue that finds effects."""
FILES = [
    path
    for package in PACKAGES
    for path in sorted((ROOT / package).rglob("*.py"))
    if not path.relative_to(ROOT).as_posix().startswith(OF_EFFECTS)
]


def test_there_is_something_to_look_at() -> None:
    assert len(FILES) > 300
    assert "lag" in catalogue()


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_no_effect_is_known_by_name(path: Path) -> None:
    names = set(catalogue())
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            assert node.value not in names, f"line {node.lineno} names the effect {node.value!r}"
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("glovecal_models.effects"):
            assert (node.module or "").startswith(OPEN), f"line {node.lineno} imports {node.module}"
