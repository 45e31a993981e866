"""No import circles: what lies beside each other in a package can be put in an order of layers.

Imports inside functions and for type checkers count too: a circle that runs is still a circle to a reader.
"""

from __future__ import annotations

import ast
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TOPS = [
    ROOT / "models" / "glovecal_models",
    ROOT / "client" / "glovecal_client",
    ROOT / "service" / "glovecal_service",
]


def packages() -> list[Path]:
    """Every package that has packages in it."""
    found = [folder for top in TOPS for folder in (top, *top.rglob("*")) if is_package(folder)]
    return [folder for folder in found if any(is_package(child) for child in folder.iterdir())]


def is_package(folder: Path) -> bool:
    return (folder / "__init__.py").is_file()


def dotted(path: Path) -> tuple[str, ...]:
    """``.../glovecal_service/cli/demo.py`` is glovecal_service, cli, demo."""
    (top,) = [top for top in TOPS if path.is_relative_to(top)]
    return path.relative_to(top.parent).with_suffix("").parts


@cache
def imports(file: Path) -> frozenset[tuple[str, ...]]:
    """Everything that a file imports, with the imported name last."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {tuple(alias.name.split(".")) for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            start = dotted(file)[: -node.level] if node.level else ()
            module = (*start, *(node.module.split(".") if node.module else ()))
            found |= {(*module, alias.name) for alias in node.names}
    return frozenset(found)


def layers(package: Path) -> dict[str, set[str]]:
    """For each module and package directly below ``package``: which of its siblings it imports."""
    here = dotted(package)
    children = {path.stem for path in package.iterdir() if path.suffix == ".py" or is_package(path)}
    graph: dict[str, set[str]] = {child: set() for child in children}
    for file in package.rglob("*.py"):
        child = dotted(file)[len(here)]
        if child not in graph:  # a folder of scripts, no package
            continue
        for target in imports(file):
            if target[: len(here)] == here and len(target) > len(here):
                name = target[len(here)]
                graph[child].add(name if name in children else "__init__")
        graph[child].discard(child)
    return graph


@pytest.mark.parametrize("package", packages(), ids=lambda package: ".".join(dotted(package)))
def test_siblings_import_each_other_in_one_direction_only(package: Path) -> None:
    graph = layers(package)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        circle = " <- ".join(error.args[1])
        pytest.fail(f"a circle of imports in {'.'.join(dotted(package))}: {circle}")
