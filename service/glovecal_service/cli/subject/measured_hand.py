"""Hand dimensions on the command line: the hand's length alone, or a file with more of them."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated

import typer

from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.skeleton import Handedness
from glovecal_service.cli.terminal.refusal import Refusal

HandLength = Annotated[
    float | None,
    typer.Option(
        "--hand-length-mm", help="From the wrist crease to the tip of the middle finger; the rest follows."
    ),
]
DimensionsFile = Annotated[
    Path | None,
    typer.Option(
        "--dimensions",
        help="TOML file of what was measured in mm, such as hand_length = 190; glovecal subject skeleton "
        "NAME lists all names.",
        exists=True,
        dir_okay=False,
    ),
]
Hand = Annotated[Handedness | None, typer.Option("--hand", help="right or left.")]


def measured_dimensions(length_mm: float | None, file: Path | None) -> dict[str, float]:
    """What was measured, in mm; the length given by itself counts. Raises Refusal that names the file."""
    try:
        measured = {} if file is None else tomllib.loads(file.read_text(encoding="utf-8"))
        wrong = [name for name, value in measured.items() if type(value) not in (int, float)]
        if wrong:
            raise BadInput(f"{wrong[0]} is {measured[wrong[0]]!r}; give a number of mm")
        if length_mm is not None:
            measured["hand_length"] = length_mm
        HandDimensions.from_measured(measured)
    except (BadInput, tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise Refusal(f"{file}: {error}" if file is not None else str(error)) from error
    return {name: float(value) for name, value in measured.items()}
