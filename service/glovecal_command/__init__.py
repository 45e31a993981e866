"""The command ``glovecal`` of the distribution ``glovecal``: the service's, or a sentence if it is missing.

``pip install glovecal`` brings the client alone, ``glovecal[service]`` what this command needs; tools that
install one distribution for its commands (uv tool, pipx) take them from the one that was named.
"""

from __future__ import annotations

import sys
from importlib.util import find_spec

from glovecal_client.installation import install_command


def main() -> int | None:
    """Run the service's command on the process's arguments; 1 with a sentence where there is no service."""
    if find_spec("glovecal_service") is None:
        print(
            "glovecal needs the service, which is not installed here: "
            f"{install_command('glovecal[service]')}. "
            "To capture a glove without it, use glovecal-capture.",
            file=sys.stderr,
        )
        return 1
    from glovecal_service.cli.command import main as run_command

    return run_command()
