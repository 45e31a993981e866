"""The public interface is one sorted list, and every name in it is there."""

from __future__ import annotations

import subprocess
import sys
from importlib import metadata

import glovecal_client
from glovecal_client import errors


def test_public_names_are_sorted_unique_and_there() -> None:
    names = glovecal_client.__all__
    constants = [name for name in names if name.isupper()]
    classes = [name for name in names if name[0].isupper() and not name.isupper()]
    functions = [name for name in names if name.islower()]
    assert names == sorted(constants) + sorted(classes) + sorted(functions)
    assert len(set(names)) == len(names)
    imported = {
        name
        for name, value in vars(glovecal_client).items()
        if not name.startswith("_") and getattr(value, "__module__", "").startswith("glovecal_client")
    }
    assert imported <= set(names)
    assert all(hasattr(glovecal_client, name) for name in names)


def test_every_error_is_public() -> None:
    own = {
        name
        for name, value in vars(errors).items()
        if isinstance(value, type) and issubclass(value, errors.ClientError)
    }
    assert own <= set(glovecal_client.__all__)


def test_importing_the_client_brings_nothing_but_numpy_and_zenoh() -> None:
    script = (
        "import sys, glovecal_client, glovecal_client.capture.command\n"
        "bad = {'scipy', 'serial', 'httpx', 'fastapi', 'glovecal_models', 'glovecal_service', 'typer'}\n"
        "sys.exit(' '.join(sorted(bad & set(sys.modules))) or 0)\n"
    )
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr) == (0, "")


def test_capture_command_is_installed() -> None:
    scripts = {point.name: point.value for point in metadata.entry_points(group="console_scripts")}
    assert scripts["glovecal-capture"] == "glovecal_client.capture.command:script"
