"""``glovecal camera sheets``: the glove, its colours and the camera's board, to print."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_service.cli.camera.extra import camera_extra
from glovecal_service.cli.subject.subjects import DimensionsFile, Hand, HandLength, measured_dimensions
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, subject_named
from glovecal_service.cli.terminal.printing import out, print_json
from glovecal_service.cli.terminal.refusal import Refusal


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
        from glovecal_models.colour_glove.sheets.calibration_board import CalibrationBoard, board_sheet
        from glovecal_models.colour_glove.sheets.colour_card import colour_card
        from glovecal_models.colour_glove.sheets.glove_sheets import glove_sheets, patch_sheets
        from glovecal_models.colour_glove.sheets.sheet import write_sheets
        from glovecal_models.colour_glove.skin import hand_skin

    measured = measured_dimensions(hand_length_mm, dimensions)
    if subject is not None:
        with connect() as service:
            known = service.get(f"/subjects/{subject}")
        measured = known["dimensions"] | measured
        hand = hand or known["hand"]
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
