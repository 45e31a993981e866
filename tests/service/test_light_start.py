"""What every command and every service loads, it waits for."""

from __future__ import annotations

import subprocess
import sys

PROGRAM = """
import sys, glovecal_service.cli.command, glovecal_service.rest.app
slow = {"scipy.signal", "scipy.stats", "scipy.integrate", "scipy.ndimage", "numba", "cv2", "nicegui"}
print(*(slow & set(sys.modules)))
"""
READ = """
import linecache, sys, glovecal_service.rest.app
ours = {module.__file__ for name, module in sys.modules.items() if name.startswith("glovecal_")}
print(*(ours & set(linecache.cache)))
"""


def _printed_by(program: str) -> list[str]:
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return run.stdout.split()


def test_a_command_does_not_load_what_only_some_work_needs():
    assert _printed_by(PROGRAM) == []


def test_a_service_does_not_read_its_own_source_when_it_starts():
    """Descriptions of fields are read from it for a schema, when somebody asks: all of them take seconds."""
    assert _printed_by(READ) == []
