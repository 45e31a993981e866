"""The pages about the library: every name is there, and they use no other. What they print: tests/docs."""

from __future__ import annotations

import ast
import inspect
import re
from pathlib import Path

import pytest

import glovecal

DOCS = Path(__file__).resolve().parents[3] / "docs"
NOTEBOOK, LIBRARY, OWN_EFFECT = (
    (DOCS / name).read_text(encoding="utf-8") for name in ("notebook.md", "library.md", "own-effect.md")
)


def blocks(text: str, language: str) -> list[str]:
    every = re.findall(r"^```(\w*)\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    return [content for found, content in every if found == language]


def test_every_name_has_its_line():
    named = re.findall(r"^\| `(\w+)` \| ", LIBRARY, re.MULTILINE)
    assert sorted(named) == glovecal.__all__


@pytest.mark.parametrize("example", re.findall(r"\| `([^`]+)` \|$", LIBRARY, re.MULTILINE))
def test_examples_call_public_names_with_options_they_have(example):
    for node in ast.walk(ast.parse(example)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id != "print":
            assert node.func.id in glovecal.__all__
            accepted = inspect.signature(getattr(glovecal, node.func.id)).parameters
            assert {word.arg for word in node.keywords} <= set(accepted)


def test_pages_import_public_names_only():
    for page in (NOTEBOOK, OWN_EFFECT):
        for code in blocks(page, "python"):
            assert "glovecal_models" not in code
            used = set(re.findall(r"glovecal\.(\w+)", code))
            assert used <= set(glovecal.__all__)
    assert set(re.findall(r"`@?glovecal\.(\w+)`", OWN_EFFECT + NOTEBOOK)) <= set(glovecal.__all__)
