"""Long work steps back behind the live stream and never forward, which an ordinary user may not."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

if sys.platform == "win32":
    pytest.skip("Windows has priority classes, no niceness", allow_module_level=True)


@pytest.mark.parametrize(("begun_at", "works_at"), [(0, 10), (15, 15)])
@pytest.mark.parametrize("step", ["step_back", "step_back_in_this_thread"])
def test_a_command_that_was_begun_behind_stays_there(step: str, begun_at: int, works_at: int) -> None:
    program = (
        f"import os; os.nice(max(0, {begun_at} - os.nice(0)))\n"
        f"from glovecal_service.operating_system import {step}\n"
        f"{step}(); print(os.nice(0))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert int(done.stdout) == max(works_at, os.nice(0))
