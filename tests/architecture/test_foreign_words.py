"""No exception's own text reaches a person: what a library or Python says of itself is for the log.

Looked at is each ``except`` of a type that is not ours: there the exception may be chained, looked into
(``error.strerror``, ``error.lineno``) and logged, but neither formatted nor turned into text.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PARTS = ("models/glovecal_models", "models/glovecal", "client/glovecal_client", "service/glovecal_service")
OURS = ("glovecal_models", "glovecal_client", "glovecal_service", "glovecal")
READ_ONLY = ("log", "re")
"""Logs, and looks for the place in a text where a parser stopped."""


def foreign_texts(tree: ast.Module) -> Iterator[int]:
    """Lines in which the text of a foreign exception is used."""
    ours = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in OURS
        for alias in node.names
    } | {node.name for node in ast.walk(tree) if isinstance(node, ast.ClassDef)}
    for handler in ast.walk(tree):
        if isinstance(handler, ast.ExceptHandler) and handler.name and _is_foreign(handler.type, ours):
            for statement in handler.body:
                yield from _uses_as_text(statement, handler.name)


def _is_foreign(kind: ast.expr | None, ours: set[str]) -> bool:
    names = kind.elts if isinstance(kind, ast.Tuple) else [kind]
    return any(not (isinstance(name, ast.Name) and name.id in ours) for name in names)


def _uses_as_text(node: ast.AST, name: str) -> Iterator[int]:
    if isinstance(node, ast.Call):
        function = node.func
        owner = function.value if isinstance(function, ast.Attribute) else None
        if isinstance(owner, ast.Name) and owner.id in READ_ONLY:
            return
        if (
            isinstance(function, ast.Name)
            and function.id in ("str", "repr", "ascii")
            and _is(node.args, name)
        ):
            yield node.lineno
    if isinstance(node, ast.FormattedValue) and _is([node.value], name):
        yield node.lineno
    if isinstance(node, ast.Attribute) and node.attr == "args" and _is([node.value], name):
        yield node.lineno
    for child in ast.iter_child_nodes(node):
        yield from _uses_as_text(child, name)


def _is(nodes: list[ast.expr], name: str) -> bool:
    """The exception itself, or one of an alternative of which it is one."""
    for node in nodes:
        if isinstance(node, ast.Name) and node.id == name:
            return True
        if isinstance(node, ast.BoolOp) and _is(node.values, name):
            return True
        if isinstance(node, ast.IfExp) and _is([node.body, node.orelse], name):
            return True
        if isinstance(node, ast.Subscript) and _is([node.value], name):
            return True
    return False


@pytest.mark.parametrize("part", PARTS)
def test_what_others_say_stays_in_the_log(part: str) -> None:
    for path in sorted((ROOT / part).rglob("*.py")):
        lines = sorted(set(foreign_texts(ast.parse(path.read_text(encoding="utf-8")))))
        place = path.relative_to(ROOT).as_posix()
        assert not lines, f"{place}: a foreign exception's text in lines {lines}"
