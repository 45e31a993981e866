"""``glovecal camera patterns``: what the printed colours leave ambiguous, beside other patterns."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from glovecal_service.cli.camera.extra import camera_extra
from glovecal_service.cli.terminal.options import AsJson
from glovecal_service.cli.terminal.printing import err, print_json, print_sentences, print_table

COLUMNS = {
    "name": "pattern",
    "mean_mm": "look-alike (mm)",
    "mean_sd_mm": "± (mm)",
    "p90_mm": "90 % below (mm)",
    "same_colour_mm": "same colour (mm)",
}


def patterns(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            help='Patterns of your own, JSON: {"colours": [4, 3, ...]} with 20 numbers of 1 to 10.',
            exists=True,
            dir_okay=False,
        ),
    ] = None,
    entries: Annotated[
        int, typer.Option(min=100, max=100_000, help="Rendered hands to look up among.")
    ] = 2000,
    hands: Annotated[int, typer.Option(min=10, max=10_000, help="Other hands, each looked up.")] = 200,
    as_json: AsJson = False,
) -> None:
    """Compare patterns of colours by how far apart hands are that look alike (rendered hands)."""
    with camera_extra():
        from glovecal_models.colour_glove.pattern_comparison import (
            ambiguities,
            common_patterns,
            read_pattern,
        )

    compared = {str(file): read_pattern(file) for file in files or []} | common_patterns()

    def report(name: str, share: float) -> None:
        err.print(f"{share:4.0%}  {name}")

    found = ambiguities(compared, entries=entries, queries=hands, report=None if as_json else report)
    rows = [
        {**asdict(each), "name": name, "same_colour_mm": _finite(each.same_colour_mm)}
        for name, each in found.items()
    ]
    if as_json:
        print_json(rows)
        return
    print_table(rows, COLUMNS, empty="")
    nearest = rows[0]["nearest_mm"]
    print_sentences(
        [
            f"look-alike: distance (RMS over the skin) between a hand and that one of {entries} others that "
            f"looks most alike, mean of {hands} rendered hands; ± is its standard deviation. The nearest of "
            f"those others lies {nearest:.1f} mm away: less is not possible. What a pattern "
            "leaves ambiguous is the difference; patterns closer than twice ± are alike.",
            "same colour: shortest way over the skin between the middles of two patches of one colour. "
            "20 colours: a limit; no camera tells so many apart.",
        ]
    )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
