"""The pages about the library: the cell runs and prints what it says, every name is there."""

from __future__ import annotations

import ast
import inspect
import re
import runpy
import time
from pathlib import Path

import pytest

import glovecal

DOCS = Path(__file__).resolve().parents[3] / "docs"
NOTEBOOK, LIBRARY, OWN_EFFECT = (
    (DOCS / name).read_text(encoding="utf-8") for name in ("notebook.md", "library.md", "own-effect.md")
)
LONGEST_S = 20.0
"""Of the processor: other tests run beside this one."""
LINES = 15


def blocks(text: str, language: str) -> list[str]:
    every = re.findall(r"^```(\w*)\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    return [content for found, content in every if found == language]


def numbers_rounded(line: str) -> list[str | float]:
    return [round(float(word), 1) if re.fullmatch(r"-?\d+\.\d+", word) else word for word in line.split()]


@pytest.mark.usefixtures("drawn")
def test_the_cell_prints_what_the_page_says(tmp_path: Path, capsys, monkeypatch):
    [cell] = blocks(NOTEBOOK, "python")
    assert len([line for line in cell.splitlines() if line]) <= LINES + 1, "beside the import"
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cell.py").write_text(cell, encoding="utf-8")
    started = time.process_time()
    runpy.run_path(str(tmp_path / "cell.py"))
    assert time.process_time() - started < LONGEST_S
    said = capsys.readouterr().out.splitlines()
    promised = blocks(NOTEBOOK, "")[0].splitlines()
    assert promised[-1] == "..."
    for line, expected in zip(said, promised[:-1], strict=False):
        for word, wanted in zip(numbers_rounded(line), numbers_rounded(expected), strict=True):
            assert word == (pytest.approx(wanted, abs=0.11) if isinstance(wanted, float) else wanted), line


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
