"""A compiled kernel kept on disk does not notice changes in other files: it may use none of their names."""

import ast
from pathlib import Path
from typing import TypeGuard

import pytest

import glovecal_models.colour_glove

FILES = sorted(Path(glovecal_models.colour_glove.__file__).parent.rglob("*.py"))


def is_kernel(node: ast.stmt) -> TypeGuard[ast.FunctionDef]:
    return isinstance(node, ast.FunctionDef) and any("njit" in ast.unparse(d) for d in node.decorator_list)


def test_there_are_kernels():
    assert sum(is_kernel(node) for file in FILES for node in ast.parse(file.read_text()).body) > 8


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_kernel_uses_its_own_file_only(file):
    tree = ast.parse(file.read_text(encoding="utf-8"))
    ours = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("glovecal")
        for alias in node.names
    }
    for kernel in [node for node in tree.body if is_kernel(node)]:
        used = {node.id for node in ast.walk(kernel) if isinstance(node, ast.Name)} & ours
        assert not used, f"{kernel.name} uses {sorted(used)} of other files"
