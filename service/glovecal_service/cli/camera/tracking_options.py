"""Options of the verbs that track a hand, live and recorded, and whose hand it is."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from glovecal_service.cli.terminal import connection
from glovecal_service.cli.terminal.options import subject_named


class Stage(Enum):
    nearest = "nearest"
    blend = "blend"
    ik = "ik"
    dense = "dense"


class Hand(Enum):
    right = "right"
    left = "left"


StageOption = Annotated[
    Stage, typer.Option(help="How far each picture is followed; each stage starts from the one before.")
]
ColoursOption = Annotated[
    Path | None,
    typer.Option(help="Colour table of this glove and light. Default: learned on rendered photographs."),
]
CalibrationOption = Annotated[
    Path | None, typer.Option(help="The camera, as glovecal camera calibrate makes it.")
]
SubjectOption = Annotated[
    str | None,
    typer.Option(help="Who wears it: with the sizes that were measured.", callback=subject_named),
]
HandOption = Annotated[
    Hand | None, typer.Option(help="The hand that wears it. Default: the subject's, else the right one.")
]
ShapeOption = Annotated[
    Path | None,
    typer.Option(help="The hand's shape, as glovecal camera shape finds it.", exists=True, dir_okay=False),
]
EntriesOption = Annotated[
    int, typer.Option(min=300, max=1_000_000, help="Of the pose database; the paper has 100,000.")
]
ClipsOption = Annotated[
    int, typer.Option(min=3, max=1000, help="Rendered clips from which the stated deviations are learned.")
]
DataOption = Annotated[
    Path, typer.Option(envvar="GLOVECAL_DATA", help="Folder of the database and of what is kept.")
]


def worn_by(subject: str | None, hand: Hand | None) -> tuple[dict[str, float], str]:
    """What was measured of the subject's hand, mm, and which hand wears the glove."""
    sizes_mm, own = {}, Hand.right.value
    if subject is not None:
        with connection.connect() as client:
            known = client.get(f"/subjects/{subject}")
        sizes_mm, own = known["dimensions"], known["hand"]
    return sizes_mm, own if hand is None else hand.value
