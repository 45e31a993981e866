"""``glovecal demo``: the whole spine on a bare machine, no question asked."""

from __future__ import annotations

import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import typer

from glovecal_service.cli.printing import err, out, show


def demo(
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the figures as one line of JSON, last.")
    ] = False,
    keep: Annotated[bool, typer.Option("--keep", help="Leave the service and a live glove running.")] = False,
    seed: Annotated[int, typer.Option(help="Which simulated hand and glove.")] = 1,
) -> None:
    """Calibrate a simulated CyberGlove over real zenoh and show what it brings, in under 90 seconds."""
    from glovecal_service.demo.keeping import keep_running
    from glovecal_service.demo.processes import demo_place, running_service
    from glovecal_service.demo.table import contract, error_table, sentences
    from glovecal_service.demo.walk import walk

    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="glovecal-demo-") as folder:
        place = demo_place(Path(folder))
        err.print("Starting glovecal serve ...")
        with running_service(place) as service:
            found = walk(service, place, seed, lambda sentence: err.print(sentence))
            out.print()
            show(error_table(found))
            out.print()
            for sentence in sentences(found, time.monotonic() - started):
                out.print(sentence)
            out.print(NEXT)
            if as_json:
                sys.stdout.write(json.dumps(contract(found)) + "\n")
                sys.stdout.flush()
            if keep:
                keep_running(place, seed, lambda sentence: err.print(sentence))


NEXT = """
Where to look next:
  glovecal demo --keep      leaves it running, with the address of its REST interface
  glovecal serve            your own service; then glovecal capture --device cyberglove --glove right
  glovecal take import      calibrate from recordings you have (CSV, Parquet)
  README.md                 connect your glove, walk the loop, deploy"""
