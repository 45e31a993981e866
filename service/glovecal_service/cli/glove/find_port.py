"""``glovecal find-port``: which serial port has a glove on it."""

from __future__ import annotations

from typing import Annotated

import typer

from glovecal_service.cli.terminal.options import AsJson
from glovecal_service.cli.terminal.printing import print_json, print_table


def find_port(
    port: Annotated[list[str] | None, typer.Argument(help="Further ports or patterns to try.")] = None,
    as_json: AsJson = False,
) -> None:
    """Try every serial port and show what answers. Takes some seconds."""
    from glovecal_client.capture.cyberglove.find_port import find_ports

    found = [item.to_json() for item in find_ports(port or [])]
    if as_json:
        print_json(found)
        return
    columns = {"path": "port", "kind": "what", "sentence": "what answered"}
    print_table(found, columns, empty="No serial ports found. Is the cable plugged in?")
