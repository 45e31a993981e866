"""What ``import glovecal`` gives: a complete, sorted, documented list, and nothing heavy."""

from __future__ import annotations

import ast
import inspect
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import glovecal
from glovecal._shown import Shown

PACKAGE = Path(inspect.getfile(glovecal)).parent
FOREIGN = {"glovecal_service", "glovecal_client", "zenoh", "fastapi", "httpx", "requests", "socket", "pickle"}


def test_the_list_is_complete_and_sorted():
    public = {
        name
        for name, value in vars(glovecal).items()
        if not name.startswith("_") and not isinstance(value, ModuleType) and name != "annotations"
    }
    assert set(glovecal.__all__) == public
    assert glovecal.__all__ == sorted(glovecal.__all__)


@pytest.mark.parametrize("name", glovecal.__all__)
def test_every_name_says_what_it_is(name):
    assert inspect.getdoc(getattr(glovecal, name))


def results() -> list[type]:
    values = [getattr(glovecal, name) for name in glovecal.__all__]
    return [value for value in values if isinstance(value, type) and issubclass(value, Shown)]


@pytest.mark.parametrize("kind", results(), ids=lambda kind: kind.__name__)
def test_every_attribute_of_a_result_says_what_it_is(kind):
    silent = [
        name
        for name, value in vars(kind).items()
        if not name.startswith("_")
        and (callable(value) or isinstance(value, property))
        and not inspect.getdoc(value)
    ]
    assert not silent


@pytest.mark.parametrize("name", ["CalibrationModel", "Improvement", "train", "improve", "effects"])
def test_names_of_the_library_are_shown_without_its_files(name):
    assert getattr(glovecal, name).__module__ == "glovecal"


def test_importing_it_loads_nothing_heavy():
    program = "import sys, glovecal; print(*{name.split('.')[0] for name in sys.modules})"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    loaded = set(run.stdout.split())
    assert "numpy" in loaded
    assert not loaded & {"matplotlib", "pandas", "scipy", "pyarrow", "zenoh", "fastapi", "glovecal_service"}


def test_it_needs_nothing_that_the_models_do_not():
    for path in PACKAGE.glob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        names = [
            alias.name if isinstance(node, ast.Import) else node.module or ""
            for node in ast.walk(tree)
            if isinstance(node, ast.Import | ast.ImportFrom)
            for alias in node.names
        ]
        assert not {name.split(".")[0] for name in names} & FOREIGN, path.name


def test_options_are_given_by_name():
    for name in ("train", "diagnose", "add_effect", "remove_effect", "improve", "simulate", "load_model"):
        given = list(inspect.signature(getattr(glovecal, name)).parameters.values())
        assert all(
            item.kind is inspect.Parameter.KEYWORD_ONLY or item.default is item.empty or item.name == "effect"
            for item in given
        ), name
