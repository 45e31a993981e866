"""``glovecal capture``: record and publish a glove (the same as ``glovecal-capture``)."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Annotated

import typer

from glovecal_service.cli.printing import err, out


def capture(
    device: Annotated[
        str,
        typer.Option(
            help="cyberglove, cyberglove:PORT, replay:FILE, simulated, or another's NAME[:ARGUMENT]."
        ),
    ],
    glove: Annotated[str, typer.Option(help="Name of this glove on the wire, such as right-hand.")],
    subject: Annotated[str | None, typer.Option(help="Who wears it.")] = None,
    wearing: Annotated[str | None, typer.Option(help="Name of this donning.")] = None,
    option: Annotated[list[str] | None, typer.Option(help="KEY=VALUE for the device; repeat.")] = None,
    connect: Annotated[str | None, typer.Option(help="The service's zenoh endpoint.")] = None,
    site: Annotated[str, typer.Option(envvar="GLOVECAL_SITE")] = "lab",
    data: Annotated[Path, typer.Option(envvar="GLOVECAL_DATA", help="Where the local log goes.")] = Path(
        "glovecal-data"
    ),
) -> None:
    """Record a glove to the local log and publish it. Ctrl-C stops it."""
    import os

    from glovecal_client.capture.command import parse_options, run_capture, stopped_by_signals
    from glovecal_client.session import DEFAULT_ENDPOINT

    stop = threading.Event()
    endpoint = connect or os.environ.get("GLOVECAL_ZENOH", DEFAULT_ENDPOINT)
    with stopped_by_signals(stop):
        summary = run_capture(
            device,
            glove,
            options=parse_options(option or []),
            site=site,
            subject=subject,
            wearing=wearing,
            endpoints=[endpoint],
            data=data,
            stop=stop,
            report=lambda sentence: err.print(sentence, markup=False),
        )
    out.print(str(summary), markup=False)
