"""``glovecal camera colours``: the table by which the glove's colours are told, from pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from glovecal_service.cli.camera.extra import camera_extra
from glovecal_service.cli.camera.sheets import Paper
from glovecal_service.cli.terminal.options import AsJson
from glovecal_service.cli.terminal.printing import out, print_json
from glovecal_service.cli.terminal.refusal import Refusal

SUFFIX = ".npz"


def colours(
    pictures: Annotated[
        list[Path],
        typer.Argument(
            help="Pictures of the printed colour card in the light of the recording; or with --labelled "
            "of the glove.",
            exists=True,
            dir_okay=False,
            show_default=False,
        ),
    ],
    file: Annotated[Path, typer.Option("--out", help="Colour table to write (.npz).", dir_okay=False)],
    paper: Annotated[Paper, typer.Option(help="What the card is printed on.")] = Paper.a4,
    corners: Annotated[
        str | None,
        typer.Option(
            help="Of the card's page in a single picture, pixels from the left and the top, with the clock: "
            '"120,80 500,90 510,640 110,630". Default: they are found.'
        ),
    ] = None,
    labelled: Annotated[
        bool,
        typer.Option(
            "--labelled",
            help="Beside each hand.jpg lies hand.labels.png, grey levels 0 (no glove) to 10 (its colours).",
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Make a colour table for glovecal camera track --colours: for a printer, a camera and its light.

    From the card: its ten colours and the light's are measured, drawn photographs of the glove take them on,
    and the table is learned on these. From labelled pictures it is learned on them alone.
    """
    with camera_extra():
        from glovecal_models.colour_glove.palette import COLOUR_NAMES, encoded_light
        from glovecal_models.colour_glove.pictures.card_picture import card_colours
        from glovecal_service.camera.learned_colours import drawn_table, labelled_table, picture_file

    if file.suffix != SUFFIX or not file.absolute().parent.is_dir():
        raise Refusal(f"{file} cannot be written: a colour table ends in {SUFFIX}, in a folder that exists")
    if labelled:
        labelled_table(pictures).save(file)
        if as_json:
            print_json({"file": str(file), "pictures": len(pictures)})
        else:
            out.print(f"Learned on {len(pictures)} labelled pictures. Wrote {file}.")
        return
    card = card_colours(
        [picture_file(each) for each in pictures], paper.value, None if corners is None else _corners(corners)
    )
    drawn_table(card=card).save(file)
    levels = encoded_light(card.inks).tolist()
    gains = {"red": card.gains.red, "green": card.gains.green, "blue": card.gains.blue}
    if as_json:
        print_json(
            {
                "file": str(file),
                "pictures": len(pictures),
                "corners_px": card.corners_px.tolist(),
                "gains": gains,
                "srgb": dict(zip(COLOUR_NAMES, levels, strict=True)),
            }
        )
        return
    for number, (name, level) in enumerate(zip(COLOUR_NAMES, levels, strict=True), 1):
        out.print(f"{number:2} {name}: sRGB {' '.join(map(str, level))} in white light")
    out.print(
        f"The light: red / green {1 / gains['red']:.2f}, blue / green {1 / gains['blue']:.2f} (1: white). "
        f"Learned on drawn photographs in these colours. Wrote {file}."
    )


def _corners(text: str) -> np.ndarray:
    try:
        found = np.array([[float(value) for value in pair.split(",")] for pair in text.split()])
    except ValueError:
        found = np.zeros(0)
    if found.shape != (4, 2) or not np.isfinite(found).all():
        raise typer.BadParameter(
            f'--corners {text!r}: expected four pairs, as in "120,80 500,90 510,640 110,630"'
        )
    return found
