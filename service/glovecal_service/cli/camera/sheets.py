"""``glovecal camera sheets`` and ``patterns``: what is printed, and what its colours leave ambiguous."""

from __future__ import annotations

import math
from dataclasses import asdict
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.rotations import known_hand
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_service.cli.camera.tracking_options import camera_extra
from glovecal_service.cli.subject.subjects import DimensionsFile, Hand, HandLength, measured_dimensions
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, subject_named
from glovecal_service.cli.terminal.printing import Refusal, err, out, print_json, print_sentences, print_table
from glovecal_service.plain import read
from glovecal_service.rest.subject.answer import Subject


class Paper(Enum):
    a4 = "a4"
    letter = "letter"


PatternFile = Annotated[
    Path | None,
    typer.Option(
        help='Own colours for the 20 patches, JSON: {"colours": [4, 3, ...]} with numbers of 1 to 10.',
        exists=True,
        dir_okay=False,
    ),
]


def sheets(
    folder: Annotated[
        Path, typer.Option("--out", help="Folder to write to; sheets there are replaced.", file_okay=False)
    ],
    subject: Annotated[
        str | None,
        typer.Option("--subject", "-s", help="Use this subject's hand and sizes.", callback=subject_named),
    ] = None,
    hand: Hand = None,
    hand_length_mm: HandLength = None,
    dimensions: DimensionsFile = None,
    paper: Annotated[Paper, typer.Option(help="What the printer holds.")] = Paper.a4,
    pattern: PatternFile = None,
    as_json: AsJson = False,
) -> None:
    """Write the colour glove, its patches, a colour card and a calibration board as PDF and SVG."""
    with camera_extra():
        from glovecal_models.colour_glove.pattern import printed_pattern
        from glovecal_models.colour_glove.pattern_comparison import read_pattern
        from glovecal_models.colour_glove.sheets.calibration_board import (
            CalibrationBoard,
            board_sheet,
            colour_card,
        )
        from glovecal_models.colour_glove.sheets.glove_sheets import glove_sheets, patch_sheets
        from glovecal_models.colour_glove.sheets.sheet import write_sheets
        from glovecal_models.colour_glove.skin import hand_skin

    measured = measured_dimensions(hand_length_mm, dimensions)
    if subject is not None:
        with connect() as service:
            known = read(Subject, service.get(f"/subjects/{subject}"))
        measured = known.dimensions | measured
        hand = hand or known_hand(known.hand)
    try:
        sizes = HandDimensions.from_measured(measured)
    except BadInput as error:
        raise Refusal(str(error)) from error
    skin = hand_skin(hand_skeleton(sizes, hand or "right"))
    printed = printed_pattern() if pattern is None else read_pattern(pattern)
    written = {
        "glove": write_sheets(folder, "glove", glove_sheets(skin, printed, paper.value)),
        "patches": write_sheets(folder, "patches", patch_sheets(skin, printed, paper.value)),
        "colour card": write_sheets(folder, "colour-card", [colour_card(paper.value)]),
        "board": write_sheets(folder, "board", [board_sheet(paper.value)]),
    }
    if as_json:
        print_json(
            {
                "hand": hand or "right",
                "hand_length_mm": sizes.hand_length_mm,
                "assumed": sizes.is_assumed,
                "paper": paper.value,
                "square_mm": CalibrationBoard().square_mm,
                "files": {name: [str(file) for file in files] for name, files in written.items()},
            }
        )
        return
    said = "assumed; give --hand-length-mm or --subject" if sizes.is_assumed else "measured"
    out.print(f"For a {hand or 'right'} hand of {sizes.hand_length_mm:g} mm ({said}):")
    for name, files in written.items():
        more = f", and as SVG ({len(files) - 1} page{'s' if len(files) > 2 else ''})"
        out.print(f"  {name}: {files[0]}{more}")
    out.print("Print at 100 % and measure the 100 mm bar. How to sew, iron or paint: page 1 of glove.pdf.")
    meanwhile = "Meanwhile, so that the first start takes seconds"
    if subject is None:
        out.print(f"{meanwhile}: glovecal camera prepare")
    else:
        out.print(f"{meanwhile}: glovecal camera prepare --subject {subject}")


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
    nearest = next(iter(found.values())).nearest_mm
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
