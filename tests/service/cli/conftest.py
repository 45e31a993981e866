"""A folder with takes and models made through the command line, shared by tests that change nothing in it."""

from __future__ import annotations

import dataclasses
import sys
from functools import partial
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from cli_running import Run, glovecal, simulated

from glovecal_models.takes.write_table import write_takes


@pytest.fixture(scope="session")
def tables(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """``train.csv`` (two takes), ``test.frames.csv`` with ``test.reference.csv``, ``other.parquet``."""
    folder = tmp_path_factory.mktemp("tables")
    write_takes([simulated("key_poses", "poses"), simulated("cross_couple", "cross")], folder / "train.csv")
    test = simulated("evaluation", "second", wearing=1)
    late = dataclasses.replace(test, reference_time_s=test.reference_time_s + 0.004)
    write_takes([late], folder / "test.csv")
    write_takes([simulated("thumb", "thumb")], folder / "other.parquet")
    return folder


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """The command on an empty data folder; called with the arguments."""
    return partial(glovecal, {"GLOVECAL_DATA": str(tmp_path / "data")})


@pytest.fixture(scope="session")
def anna(tmp_path_factory: pytest.TempPathFactory, tables: Path) -> Run:
    """The command on a data folder with subject ``anna`` and three takes; nothing may be changed there."""
    run = partial(glovecal, {"GLOVECAL_DATA": str(tmp_path_factory.mktemp("anna") / "data")})
    assert run("subject", "add", "anna", "--title", "Anna Ruiz").code == 0
    imported = run("take", "import", tables / "train.csv", tables / "test.frames.csv", "-s", "anna")
    assert imported.code == 0, imported.err
    return run
