"""``glovecal take motion``: takes as calibrated motion, for animation tools and analysis."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from glovecal_service.cli.take.rows import find_take
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import model_id
from glovecal_service.cli.terminal.writing import Overwrite, require_place, write_whole

MOST_HANDS = 2


def _models(given: list[str] | None) -> list[str] | None:
    for id in given or ():
        model_id(id)
    return given


def motion(
    file: Annotated[Path, typer.Argument(help="Where to write; .trc, .csv or .parquet.")],
    take: Annotated[list[str], typer.Argument(help="One take, or a take of each hand: names or ids.")],
    content: Annotated[
        Literal["joints", "angles", "raw"],
        typer.Option(help="Places of joints in mm, calibrated degrees, or readings as they came."),
    ] = "joints",
    model: Annotated[
        list[str] | None,
        typer.Option("--model", "-m", help="One a take; default: the active ones.", callback=_models),
    ] = None,
    shift: Annotated[
        list[float] | None,
        typer.Option(help="Seconds added to each take's times; default: as take hands tells."),
    ] = None,
    claps: Annotated[
        bool, typer.Option("--claps", help="Join two hands by claps that both gloves felt.")
    ] = False,
    overwrite: Overwrite = False,
) -> None:
    """Write one hand or both as motion: TRC for OpenSim and MotionBuilder, CSV or Parquet for analysis."""
    from glovecal_service.exports.formats import format_of

    chosen = format_of(file.name)
    if len(take) > MOST_HANDS:
        raise typer.BadParameter(f"{len(take)} takes are too many: one, or one of each hand")
    require_place(file, overwrite=overwrite)
    with connect() as service:
        rows = service.get("/takes")
        body = {
            "takes": [find_take(rows, name)["id"] for name in take],
            "models": model or [],
            "content": content,
            "format": chosen.suffix.removeprefix("."),
            "shifts_s": shift or [],
            "claps": claps,
        }
        write_whole({file: service.made("/motion", body)})
