"""``glovecal shapes``: the calibration sequence at the start and the end of a session, and its drift."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

import typer

from glovecal_client.errors import ServiceError
from glovecal_models.takes.session_drift import SHAPES
from glovecal_service.cli.glove.beside import finish_video, video_beside, warn_of_cold_gloves
from glovecal_service.cli.glove.recordings import finish_takes, start_takes
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson
from glovecal_service.cli.terminal.printing import err, out, print_json
from glovecal_service.cli.terminal.waiting import wait_seconds
from glovecal_service.plain import read
from glovecal_service.rest.glove.answer import Gloves, Recording


def shapes(
    gloves: Annotated[list[str], typer.Argument(help="One glove, or left and right.")],
    at: Annotated[Literal["start", "end"], typer.Option(help="Which end of the session.")] = "start",
    seconds: Annotated[float, typer.Option(min=1.5, max=60, help="How long each shape is held.")] = 4.0,
    pause: Annotated[float, typer.Option(min=0, max=60, help="Seconds to get into each shape.")] = 3.0,
    video: Annotated[
        str | None, typer.Option(help="Film it: camera:0, or rendered to try; into this folder.")
    ] = None,
    warm_up: Annotated[bool, typer.Option("--warm-up", help="Wait until the gloves are warm.")] = False,
    as_json: AsJson = False,
) -> None:
    """Record five hand shapes, both hands at once, as takes start-flat, start-fist ... or end-flat ...

    At the end of a session the drift since its start is told. Film it: the video tells what a hand did.
    """
    with connect() as service, video_beside(video, f"{at}-shapes-{datetime.now():%H%M%S}") as film:
        warn_of_cold_gloves(service, gloves, wait=warm_up)
        takes: list[Recording] = []
        for shape, ask in SHAPES.items():
            err.print(f"{shape}: {ask}")
            wait_seconds(pause, "get ready", quiet=as_json)
            started = start_takes(service, gloves, {"name": f"{at}-{shape}", "lead_s": 0})
            wait_seconds(seconds, f"hold {shape}", quiet=as_json)
            takes += finish_takes(service, started)
        seen = {row.name: row.known_hand for row in read(Gloves, service.get("/gloves")).seen}
        worn = dict.fromkeys((one.subject, seen[one.glove]) for one in takes if one.subject)
        drifts = {each: _drift(service, *each) for each in worn} if at == "end" else {}
        if film is not None:
            finish_video(service, film, takes)
    if as_json:
        told = [{**found, "subject": subject, "hand": hand} for (subject, hand), found in drifts.items()]
        print_json({"takes": [one.model_dump(mode="json") for one in takes], "drifts": told})
        return
    out.print(f"{len(takes)} takes of {len(SHAPES)} shapes.")
    for (subject, hand), found in drifts.items():
        of = f"{subject}, {hand} hand" if hand else subject
        out.print(f"{of}: {found.get('sentence')}")


def _drift(service: Any, subject: str, hand: str | None) -> dict[str, Any]:
    """What is told of it, or only why nothing can be."""
    try:
        return service.post("/takes/session-drift", {"subject": subject, "hand": hand})
    except ServiceError as error:
        return {"sentence": error.detail or str(error)}
