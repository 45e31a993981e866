"""The command ``glovecal`` of the distribution ``glovecal``: the service's, or a sentence if it is missing.

``pip install glovecal`` brings the client alone, ``glovecal[service]`` what this command needs; tools that
install one distribution for its commands (uv tool, pipx) take them from the one that was named.
"""

from __future__ import annotations

import sys
from importlib.util import find_spec
from typing import NoReturn

from glovecal_client.installation import install_command
from glovecal_client.program import run_command


def script() -> NoReturn:
    """Entry point of the ``glovecal`` script: the service's own, or the sentence and exit code 1."""
    if find_spec("glovecal_service") is None:
        run_command(_without_service)
    from glovecal_service.cli.command import script as run_service_command

    run_service_command()


def _without_service() -> int:
    print(
        f"glovecal needs the service, which is not installed here: {install_command('glovecal[service]')}. "
        "To capture a glove without it, use glovecal-capture.",
        file=sys.stderr,
    )
    return 1
