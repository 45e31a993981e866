"""What every command and every service loads, it waits for."""

from __future__ import annotations

import subprocess
import sys

PROGRAM = """
import sys, glovecal_service.cli.command, glovecal_service.rest.app
slow = {"scipy.signal", "scipy.stats", "scipy.integrate", "scipy.ndimage", "numba", "cv2", "nicegui"}
print(*(slow & set(sys.modules)))
"""


def test_a_command_does_not_load_what_only_some_work_needs():
    run = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert run.stdout.split() == []
