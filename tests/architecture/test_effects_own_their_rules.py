"""Outside ``effects`` nothing decides by an effect's name, imports one, or asks whether an object is one.

Inside, an effect's own file names another only where the table between effects relates the two.
"""

from __future__ import annotations

import ast
import inspect
from pathlib import Path

import pytest

from glovecal_models.effects.catalogue import catalogue, relations

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("models/glovecal_models", "client/glovecal_client", "service/glovecal_service")
OF_EFFECTS = (
    "models/glovecal_models/effects/",
    "models/glovecal_models/simulation/causes/",
    "service/glovecal_service/demo/second_act.py",
    "service/glovecal_service/first_run/hidden_session.py",
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


@pytest.mark.parametrize("package", PACKAGES)
def test_no_effect_is_known_by_name(package: str) -> None:
    names, wrong = set(catalogue()), list[str]()
    for path in (path for path in FILES if path.is_relative_to(ROOT / package)):
        place = path.relative_to(ROOT).as_posix()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value in names:
                wrong.append(f"{place}:{node.lineno} names the effect {node.value!r}")
            if isinstance(node, ast.ImportFrom):
                module = node.module or ""
                if module.startswith("glovecal_models.effects") and not module.startswith(OPEN):
                    wrong.append(f"{place}:{node.lineno} imports {module}")
    assert wrong == []


EFFECTS = ROOT / OF_EFFECTS[0]
MACHINERY = (EFFECTS / "base", EFFECTS / "between.py", EFFECTS / "catalogue.py")


def homes() -> dict[Path, set[str]]:
    """For each file of an effect, or each of its folder, the effects that live there."""
    found: dict[Path, set[str]] = {}
    for name, effect in catalogue().items():
        file = Path(inspect.getfile(type(effect)))
        files = [file] if file.parent == EFFECTS else sorted(file.parent.glob("*.py"))
        for each in files:
            found.setdefault(each, set()).add(name)
    return found


def related(name: str) -> set[str]:
    """Effects that some row relates to that of a name."""
    rows = [row for row in relations().rows() if name in row]
    return {other for row in rows for other in row}


def test_an_effect_names_no_other_but_what_the_table_relates_to_it() -> None:
    names, at_home, wrong = set(catalogue()), homes(), list[str]()
    for path in sorted(EFFECTS.rglob("*.py")):
        if path.is_relative_to(MACHINERY[0]) or path in MACHINERY:
            continue
        mine = at_home.get(path, set())
        allowed = mine.union(*(related(name) for name in mine))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if (
                isinstance(node, ast.Constant)
                and isinstance(node.value, str)
                and node.value in names - allowed
            ):
                wrong.append(f"{path.name}:{node.lineno} names the effect {node.value!r}")
    assert wrong == []
