"""Schemas of answers are made whatever else parses Python meanwhile.

CPython 3.11 counts how deep it is in a syntax tree once for all threads. Whoever parses while another does,
here a finalizer that the garbage collector runs in between, makes it raise SystemError.
"""

from __future__ import annotations

import subprocess
import sys

IN_A_PROCESS_OF_ITS_OWN = """
import ast, gc
from contextlib import suppress
from glovecal_models.comparison.answer import Comparison
from glovecal_service import plain

class Parses:
    # Freed by the collector, wherever that runs: it parses, and the next one takes its place.
    left = 60
    def __init__(self):
        self.me = self
    def __del__(self):
        with suppress(SystemError):
            ast.parse("a = [1, 2]")
        Parses.left -= 1
        if Parses.left > 0:
            Parses()

gc.freeze()
gc.set_threshold(200)
Parses()
plain._adapter(Comparison)
assert Parses.left < 60
print("made")
"""


def test_schemas_are_made_beside_others_that_parse() -> None:
    made = subprocess.run(
        [sys.executable, "-c", IN_A_PROCESS_OF_ITS_OWN], capture_output=True, text=True, timeout=300
    )
    assert made.stdout == "made\n", made.stderr[-2000:]
