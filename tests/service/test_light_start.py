"""What every command and every service loads, it waits for."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

SLOW = {"scipy.signal", "scipy.stats", "scipy.integrate", "scipy.ndimage", "scipy.optimize", "numba", "cv2"}
SERVICE = f"""
import sys, glovecal_service.cli.command, glovecal_service.rest.app
from glovecal_service.rest.routes import routers
routers()
print(*({SLOW | {"nicegui"}} & set(sys.modules)))
"""
READ = """
import linecache, sys, glovecal_service.rest.app
from glovecal_service.rest.routes import routers
routers()
ours = {module.__file__ for name, module in sys.modules.items() if name.startswith("glovecal_")}
print(*(ours & set(linecache.cache)))
"""
COMMAND = """
import atexit, sys
slow = {"scipy", "glovecal_models.effects.catalogue", "glovecal_models.calibration.model"}
atexit.register(lambda: print("loaded:", *(slow & set(sys.modules))))
from glovecal_service.cli.command import main
main(sys.argv[1:])
"""


def _printed_by(program: str, *arguments: str, folder: Path | None = None) -> str:
    run = subprocess.run(
        [sys.executable, "-c", program, *arguments], capture_output=True, text=True, check=True, cwd=folder
    )
    return run.stdout.rstrip("\n")


def test_a_service_does_not_load_what_only_some_work_needs():
    assert _printed_by(SERVICE) == ""


def test_a_service_does_not_read_its_own_source_when_it_starts():
    """Descriptions of fields are read from it for a schema, when somebody asks: all of them take seconds."""
    assert _printed_by(READ) == ""


@pytest.mark.parametrize("verb", ["subject list", "take list", "person list", "key list", "audit list"])
def test_a_command_that_opens_no_model_loads_nothing_of_them(verb: str, tmp_path: Path) -> None:
    """Without a service, on a data folder of its own."""
    printed = _printed_by(COMMAND, *verb.split(), folder=tmp_path)
    assert printed.splitlines()[-1] == "loaded:", printed
