"""``glovecal read-card``: a recording from a CyberGlove III's memory card as a take table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from glovecal_service.cli.terminal.printing import out


def read_card(
    file: Annotated[Path, typer.Argument(exists=True, dir_okay=False, help="A file of the card.")],
    table: Annotated[Path, typer.Argument(dir_okay=False, help="The take table to write (CSV).")],
    layout: Annotated[str, typer.Option(help="cyberglove3-22 or cyberglove3-18.")] = "cyberglove3-22",
    frame_rate: Annotated[float, typer.Option(min=1, help="Frames a second of the glove's clock.")] = 30.0,
    multiplier: Annotated[int, typer.Option(min=1, max=4, help="Records for each frame.")] = 3,
) -> None:
    """Write a recording of a CyberGlove III memory card as a take table."""
    from glovecal_client.capture.cyberglove3.card import card_to_table

    recording = card_to_table(file, table, layout=layout, frame_rate=frame_rate, multiplier=multiplier)
    seconds = recording.times_s(frame_rate, multiplier)[-1]
    out.print(
        f"{table}: {len(recording.records)} records over {seconds:.1f} s; {recording.damaged} damaged, "
        f"{recording.skipped_bytes} bytes between records. Not interpreted: header of "
        f"{len(recording.header)} bytes, trailer of {len(recording.trailer)}.",
        soft_wrap=True,
    )
    out.print(f"glovecal take import {table} --layout {layout} --subject NAME", soft_wrap=True)
