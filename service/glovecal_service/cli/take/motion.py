"""``glovecal take motion``: takes as calibrated motion, for animation tools and analysis."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import typer

from glovecal_models.hand.rotations import Handedness
from glovecal_service.cli.take.rows import named_take
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import model_id
from glovecal_service.cli.terminal.printing import Overwrite, out, require_place, write_whole

MOST_HANDS = 2


def _models(given: list[str] | None) -> list[str] | None:
    for id in given or ():
        model_id(id)
    return given


def _hands(given: list[str] | None) -> list[str] | None:
    for hand in given or ():
        if hand not in get_args(Handedness):
            raise typer.BadParameter(f"{hand!r} is no hand: right or left")
    return given


def _names(given: str | None) -> list[str]:
    return [name.strip() for name in (given or "").split(",") if name.strip()]


def _pairs(given: list[str] | None) -> list[str] | None:
    for pair in given or ():
        if "=" not in pair:
            raise typer.BadParameter(f"{pair!r} says no bone: index_proximal=NAME")
    return given


def _existing(onto: str) -> Path:
    file = Path(onto)
    if not file.is_file():
        raise typer.BadParameter(f"{onto!r} is neither a file nor a robot hand that comes with Glovecal")
    return file


def _say_fit(row: dict[str, Any]) -> None:
    lacks = f"; it lacks {', '.join(row['missing'])}" if row["missing"] else ""
    touches = f"{row['lost']} of {row['touches']} touches lost" if row["touches"] else "no touches"
    out.print(
        f"{row['hand']} hand: {len(row['bones'])} bones found{lacks}. Its fingertips are "
        f"{row['fingertip_mm']:.1f} mm from the hand's, in the hand's size; {touches}."
    )


def motion(
    file: Annotated[Path, typer.Argument(help="Where to write; its ending is the format, such as .bvh.")],
    take: Annotated[list[str], typer.Argument(help="One take, or a take of each hand: names or ids.")],
    content: Annotated[
        Literal["joints", "angles", "raw"],
        typer.Option(help="Places of joints in mm, calibrated degrees, or readings as they came."),
    ] = "joints",
    measured: Annotated[
        bool, typer.Option("--measured", help="The angles that were measured, not those of a model.")
    ] = False,
    offline: Annotated[
        bool,
        typer.Option(
            "--offline",
            help="The model's angles estimated with both directions of time, not as they were live.",
        ),
    ] = False,
    rate: Annotated[
        float | None, typer.Option(help="Frames a second on even steps; default: the frames' own times.")
    ] = None,
    low_pass: Annotated[
        float | None,
        typer.Option(metavar="HZ", help="Leave out what is faster, without delay (Butterworth, both ways)."),
    ] = None,
    model: Annotated[
        list[str] | None,
        typer.Option("--model", "-m", help="One a take; default: the active ones.", callback=_models),
    ] = None,
    hand: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[right|left]",
            help="One a take; default: as its capture said, or its subject.",
            callback=_hands,
        ),
    ] = None,
    shift: Annotated[
        list[float] | None,
        typer.Option(help="Seconds added to each take's times; default: as take hands tells."),
    ] = None,
    claps: Annotated[
        bool, typer.Option("--claps", help="Join two hands by claps that both gloves felt.")
    ] = False,
    wrist: Annotated[
        Literal["glove", "optical"],
        typer.Option(help="Turn the hand by the glove's wrist sensors, or by markers on its back."),
    ] = "glove",
    body: Annotated[
        Path | None,
        typer.Option(exists=True, dir_okay=False, help="Markers of an optical system (TRC), to be joined."),
    ] = None,
    body_shift: Annotated[
        float | None, typer.Option(help="Seconds added to its times; default: both begin at once.")
    ] = None,
    right: Annotated[
        str | None, typer.Option(metavar="MARKERS", help="That place the right hand, see docs/two-gloves.md.")
    ] = None,
    left: Annotated[str | None, typer.Option(metavar="MARKERS", help="That place the left hand.")] = None,
    onto: Annotated[
        str | None,
        typer.Option(
            metavar="FILE|ROBOT",
            help="A character (.glb, .fbx) whose skeleton is to move; or a robot's hand, shadow, allegro, "
            "leap or its URDF, whose joint angles are written.",
        ),
    ] = None,
    bone: Annotated[
        list[str] | None,
        typer.Option(
            metavar="BONE=NAME",
            callback=_pairs,
            help="Of --onto: a bone of the hand (index_proximal, left.index_proximal) and its name there, "
            "where another is found.",
        ),
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Write one hand or both as motion: BVH for animation (on a body at rest), TRC for OpenSim and
    MotionBuilder, CSV or Parquet for analysis."""
    from glovecal_models.hand.retargeting.robot_description import KINDS
    from glovecal_service.exports.formats import format_of

    chosen = format_of(file.name)
    if len(take) > MOST_HANDS:
        raise typer.BadParameter(f"{len(take)} takes are too many: one, or one of each hand")
    require_place(file, overwrite=overwrite)
    with connect() as service:
        asked: dict[str, Any] = {
            "takes": [named_take(service, name).id for name in take],
            "models": model or [],
            "hands": hand or [],
            "content": content,
            "measured": measured,
            "offline": offline,
            "rate_hz": rate,
            "low_pass_hz": low_pass,
            "format": chosen.suffix.removeprefix("."),
            "file_name": file.name,
            "shifts_s": shift or [],
            "claps": claps,
            "wrist": wrist,
        }
        if body is not None:
            markers = {"right": _names(right), "left": _names(left)}
            asked |= {"body": {"upload": service.upload(body), "shift_s": body_shift, **markers}}
        if onto is not None:
            asked |= {"onto": onto if onto in KINDS else service.upload(_existing(onto))}
            asked |= {"bones": dict(pair.split("=", 1) for pair in bone or ())}
            for hand_row in service.post("/motion/character", asked):
                _say_fit(hand_row)
        write_whole({file: service.made("/motion", asked)})
