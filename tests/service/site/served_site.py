"""Test support: the ``glovecal`` command on a data folder and ports of its own, for a service of a site."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from site_support import free_port

GLOVECAL = [sys.executable, "-m", "glovecal_service.cli.command"]


class Served:
    """A data folder, free ports, and the command with them."""

    def __init__(self, place: Path) -> None:
        self.place = place
        self.zenoh, self.port = f"tls/0.0.0.0:{free_port()}", free_port()
        self.environment = {name: value for name, value in os.environ.items() if "GLOVECAL" not in name} | {
            "GLOVECAL_DATA": str(place / "data"),
            "GLOVECAL_ZENOH": self.zenoh,
            "GLOVECAL_PORT": str(self.port),
            "GLOVECAL_HOST": "0.0.0.0",
        }

    def run(self, *words: str, **more: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*GLOVECAL, *words],
            env=self.environment | more,
            cwd=self.place,
            capture_output=True,
            text=True,
            check=False,
        )
