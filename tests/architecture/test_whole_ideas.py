"""A module with one importer is mostly a fragment of it: there may be so many, and so many files in all."""

from __future__ import annotations

import ast
from collections import defaultdict
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = (
    "models/glovecal_models", "models/glovecal", "client/glovecal_client", "service/glovecal_service",
    "client/blender/glovecal_blender", "client/lerobot_teleoperator_glovecal/lerobot_teleoperator_glovecal",
)  # fmt: skip
MODELS = "glovecal_models"
PLUG_INS = ("glovecal_models.effects.", "glovecal_models.simulation.causes.")
MACHINERY = "glovecal_models.effects.base."
MOST_SINGLE = 30


def modules() -> dict[str, Path]:
    """Every module of the repository's packages by its dotted name."""
    found = {}
    for package in PACKAGES:
        folder = ROOT / package
        for file in folder.rglob("*.py"):
            parts = file.relative_to(folder.parent).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


@cache
def importers() -> dict[str, set[str]]:
    """For each module those that import it or something from it."""
    known, found = modules(), defaultdict(set)
    for name, file in known.items():
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                for alias in node.names:
                    full = f"{node.module}.{alias.name}"
                    found[full if full in known else node.module].add(name)
            elif isinstance(node, ast.Import):
                for alias in node.names:
                    found[alias.name].add(name)
    return {name: who - {name} for name, who in found.items() if name in known}


def is_plug_in(name: str) -> bool:
    return name.startswith(PLUG_INS) and not name.startswith(MACHINERY)


def test_few_modules_have_a_single_importer() -> None:
    single = sorted(
        name
        for name, who in importers().items()
        if len(who) == 1 and name.startswith(MODELS) and not is_plug_in(name)
    )
    assert len(single) <= MOST_SINGLE, f"{len(single)} modules have one importer: {', '.join(single)}"


def test_no_module_of_the_mathematics_is_imported_by_nobody() -> None:
    who = importers()
    alone = [
        name
        for name, file in modules().items()
        if name.startswith(MODELS)
        and not is_plug_in(name)
        and file.name != "__init__.py"
        and not who.get(name)
    ]
    assert alone == []
