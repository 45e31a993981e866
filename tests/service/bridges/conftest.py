"""Lets these tests import their support, and that of the command line's, by name."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "studio"))
sys.path.insert(0, str(Path(__file__).parents[1] / "cli"))
sys.path.insert(0, str(Path(__file__).parent))

from bridge_support import Stage, open_stage


@pytest.fixture
def stage() -> Iterator[Stage]:
    """A router with two gloves that move as a test wants."""
    with open_stage() as stage:
        yield stage
