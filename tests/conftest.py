"""What tests need beside the repository: without it they skip with a sentence, or fail where CI has it."""

from __future__ import annotations

import os
import re
import sys
import sysconfig
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NoReturn

import pytest

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"

# tests start some 150 processes: each would compile all packages anew where compiled files are not kept
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

MASK = os.umask(0o022)
os.umask(MASK)
SAFE_PATH = "PYTHONSAFEPATH"
OURS = {"tests", "docs", "pytest", "_pytest"}
"""pytest warns of what tests leave behind."""

COMPUTING = ("models", "paper", "study", "architecture")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files that compute come between files that wait for gloves, cables and pages: both at once."""
    files: dict[Path, list[pytest.Item]] = {}
    for item in items:
        files.setdefault(item.path, []).append(item)
    here = Path(__file__).parent
    kinds: dict[bool, list[Path]] = {True: [], False: []}
    for path in files:
        kinds[path.relative_to(here).parts[0] in COMPUTING].append(path)
    place = {
        path: (number + 0.5) / len(paths) for paths in kinds.values() for number, path in enumerate(paths)
    }
    items[:] = [item for path in sorted(files, key=place.__getitem__) for item in files[path]]


def pytest_configure(config: pytest.Config) -> None:
    """A warning in our lines is an error; one in the lines of what is installed is told and fails nothing.

    What was not closed is noticed anywhere: that stays an error.
    """
    installed = {path.name.partition(".")[0] for path in Path(sysconfig.get_path("purelib")).iterdir()}
    names = "|".join(re.escape(name) for name in installed if name.isidentifier() and name not in OURS)
    theirs = rf"({names})(\.|\Z)|.*[\\/]site-packages[\\/]"  # by its path where it is being compiled
    config.addinivalue_line("filterwarnings", f"default:::{theirs}")
    config.addinivalue_line("filterwarnings", "error::ResourceWarning")


@pytest.fixture(autouse=True)
def process_as_it_was() -> Iterator[None]:
    """A command sets its process's umask and import path; here many commands and tests share one process."""
    _reset_process()
    yield
    _reset_process()


def _reset_process() -> None:
    os.umask(MASK)
    os.environ.pop(SAFE_PATH, None)


def pytest_runtest_setup(item: pytest.Item) -> None:
    if item.get_closest_marker("needs_shared_data") is not None and not SHARED_DATA.is_dir():
        missing("needs the real recordings, which are not part of the repository")


@pytest.fixture(scope="session")
def not_here() -> Callable[[str], NoReturn]:
    """Call it with a sentence when what a test needs is not on this computer."""
    return missing


def missing(sentence: str) -> NoReturn:
    """Skip; in CI, where everything must be there, fail."""
    if os.environ.get("GLOVECAL_REQUIRE_EVERYTHING") == "1":
        pytest.fail(sentence)
    pytest.skip(sentence)
