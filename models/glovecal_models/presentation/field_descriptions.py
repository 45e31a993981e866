"""What the docstrings below a class's fields say of them, read from its source when somebody asks.

Pydantic reads them too (``use_attribute_docstrings``), but of every class, whenever one is defined: that was
half of what a service and a command waited for at their start.
"""

from __future__ import annotations

import ast
import inspect
import sys
from collections.abc import Iterable
from functools import cache
from itertools import pairwise
from typing import Any


def description_of(cls: type, field: str) -> str:
    """The docstring of a field where it was declared last; empty: it has none, or the source is not here."""
    for each in cls.__mro__:
        declared = _declared_in(each.__module__).get(each.__qualname__, {})
        if field in declared:
            return declared[field]
    return ""


def describe_fields(schema: dict[str, Any], cls: type) -> None:
    """For pydantic's ``json_schema_extra``: each field's docstring, unless the field has words of its own."""
    for name, shown in schema.get("properties", {}).items():
        if (description := description_of(cls, name)) and "description" not in shown:
            shown["description"] = description


@cache
def _declared_in(module: str) -> dict[str, dict[str, str]]:
    """By a class's name within the module: its own fields and their docstrings."""
    try:
        source = inspect.getsource(sys.modules[module])
    except (KeyError, OSError, TypeError):
        return {}
    return dict(_classes(ast.parse(source).body, ""))


def _classes(statements: Iterable[ast.stmt], within: str) -> Iterable[tuple[str, dict[str, str]]]:
    for node in statements:
        if isinstance(node, ast.ClassDef):
            name = f"{within}{node.name}"
            yield name, _fields(node)
            yield from _classes(node.body, f"{name}.")


def _fields(of: ast.ClassDef) -> dict[str, str]:
    found = {}
    for node, after in pairwise([*of.body, ast.Pass()]):
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            match after:
                case ast.Expr(value=ast.Constant(value=str(text))):
                    found[node.target.id] = inspect.cleandoc(text)
                case _:
                    found[node.target.id] = ""
    return found
