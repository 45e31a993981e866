"""Options of the verbs that track a hand, live and recorded: one object for a verb, many for its user."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from enum import Enum
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from glovecal_models.hand.rotations import known_hand
from glovecal_service.camera.camera_settings import camera_not_installed
from glovecal_service.cli.terminal import connection
from glovecal_service.cli.terminal.options import subject_named
from glovecal_service.cli.terminal.printing import Refusal
from glovecal_service.plain import read
from glovecal_service.rest.subject.answer import Subject as SubjectRow


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
MirroredOption = Annotated[
    bool,
    typer.Option(
        "--mirrored", help="Left and right of the pictures are exchanged, as a preview's often are."
    ),
]
EntriesOption = Annotated[
    int, typer.Option(min=300, max=1_000_000, help="Of the pose database; the paper has 100,000.")
]
DataOption = Annotated[
    Path, typer.Option(envvar="GLOVECAL_DATA", help="Folder of the database and of what is kept.")
]


@dataclass(frozen=True)
class TrackingOptions:
    """What the user asked for; each field is an option of a verb that ``with_tracking`` was given."""

    stage: StageOption = Stage.dense
    colours: ColoursOption = None
    calibration: CalibrationOption = None
    shape: ShapeOption = None
    subject: SubjectOption = None
    hand: HandOption = None
    mirrored: MirroredOption = False
    entries: EntriesOption = 20_000
    data: DataOption = Path("glovecal-data")

    def settings(self) -> dict[str, Any]:
        """Fields of ``TrackingSettings``, with what was measured of the subject's hand, mm."""
        sizes_mm, own = {}, Hand.right.value
        if self.subject is not None:
            with connection.connect() as client:
                known = read(SubjectRow, client.get(f"/subjects/{self.subject}"))
            sizes_mm, own = known.dimensions, known_hand(known.hand) or own
        return {
            "data": self.data, "hand": own if self.hand is None else self.hand.value,
            "stage": self.stage.value, "colours": self.colours, "calibration": self.calibration,
            "shape": self.shape, "mirrored": self.mirrored, "entries": self.entries, "sizes_mm": sizes_mm,
        }  # fmt: skip


def with_tracking(verb: Callable[..., None], *without: str) -> Callable[..., None]:
    """``verb`` for typer: in place of its parameter ``tracking`` the options, but ``without`` some."""
    known, own = (get_type_hints(each, include_extras=True) for each in (TrackingOptions, verb))
    names = [each.name for each in fields(TrackingOptions) if each.name not in without]

    @wraps(verb)
    def with_options(**given: Any) -> None:
        asked = {name: given.pop(name) for name in names}
        verb(**given, tracking=TrackingOptions(**asked))

    kind = Parameter.KEYWORD_ONLY
    parameters: list[Parameter] = []
    for name, each in signature(verb).parameters.items():
        if name == "tracking":
            for one in names:
                default = getattr(TrackingOptions, one)
                parameters.append(Parameter(one, kind, default=default, annotation=known[one]))
        else:
            parameters.append(each.replace(kind=kind, annotation=own[name]))
    vars(with_options)["__signature__"] = Signature(parameters)
    with_options.__annotations__ = {each.name: each.annotation for each in parameters}
    return with_options


@contextmanager
def camera_extra() -> Iterator[None]:
    """For imports of the colour glove. Raises Refusal that says how to install what is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise Refusal(camera_not_installed("the colour glove")) from error
