"""``glovecal capture``: record and publish a glove (the same as ``glovecal-capture``)."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from glovecal_client.private_files import keep_private
from glovecal_service.cli.terminal.options import DEFAULT_ZENOH, Site, Zenoh, identifier, subject_named

GloveOption = Annotated[
    str,
    typer.Option("--glove", help="The glove's name, such as right-hand.", callback=identifier("glove")),
]


class WithDeviceOptions(TyperCommand):
    """Its help ends with the options of every installed device."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        from glovecal_client.capture.device import device_options

        self.epilog = "\n\n".join(device_options())
        super().format_help(ctx, formatter)


def capture(
    device: Annotated[
        str,
        typer.Option(
            help="cyberglove, cyberglove:PORT, replay:FILE, simulated, or NAME[:ARGUMENT] of a driver."
        ),
    ],
    glove: GloveOption,
    subject: Annotated[str | None, typer.Option(help="Who wears it.", callback=subject_named)] = None,
    wearing: Annotated[
        str | None, typer.Option(help="Name of this donning.", callback=identifier("wearing"))
    ] = None,
    option: Annotated[
        list[str] | None, typer.Option(help="KEY=VALUE for the device, see below; repeatable.")
    ] = None,
    connect: Zenoh = DEFAULT_ZENOH,
    site: Site = "lab",
    data: Annotated[Path, typer.Option(envvar="GLOVECAL_DATA", help="Folder of the local log.")] = Path(
        "glovecal-data"
    ),
) -> None:
    """Record a glove to the local log and publish it. Ctrl-C stops it."""
    from glovecal_client.capture.command import parse_options, run_capture, tell
    from glovecal_client.capture.daemon import CaptureSettings
    from glovecal_client.keys import GloveKeys
    from glovecal_client.program import never_wait, say, stopped_by_signals

    keep_private()
    never_wait()
    stop = threading.Event()
    settings = CaptureSettings(GloveKeys(site, glove), subject, wearing, (connect,), data)
    with stopped_by_signals(stop, outlives_terminal=True):
        summary = run_capture(
            device,
            settings,
            parse_options(option or []),
            stop=stop,
            report=tell,  # not the console: it ends the program where nobody reads
        )
    say(str(summary))
