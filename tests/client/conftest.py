"""Lets the tests of this folder import its test support (the emulated gloves, loopback) by name."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

sys.path.insert(0, str(Path(__file__).parent))

if TYPE_CHECKING:
    from cyberglove_emulator import CyberGloveEmulator


@pytest.fixture
def emulate(tmp_path: Path) -> Iterator[Callable[..., CyberGloveEmulator]]:
    """Start emulated CyberGloves: ``emulate(box, persona=..., name=...)``; they end with the test."""
    from cyberglove_emulator import CyberGloveEmulator  # needs pseudo-terminals, so not for every test here

    with ExitStack() as running:

        def start(*arguments, name: str = "glove", **options) -> CyberGloveEmulator:
            return running.enter_context(CyberGloveEmulator(tmp_path / name, *arguments, **options))

        yield start
