"""``glovecal camera``: the verbs of a camera and the printed colour glove."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from glovecal_service.cli.camera.calibrate import calibrate, colours
from glovecal_service.cli.camera.recorded import estimates, prepare, shape
from glovecal_service.cli.camera.sheets import patterns, sheets
from glovecal_service.cli.camera.track import track
from glovecal_service.cli.camera.tracking_options import with_tracking
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson
from glovecal_service.cli.terminal.printing import out, print_json
from glovecal_service.operating_system import as_typed
from glovecal_service.plain import read, video_name
from glovecal_service.rest.glove.answer import CameraVideo


def store(
    name: Annotated[
        str, typer.Argument(help="Name to keep them under: a-z, 0-9, _ and -.", show_default=False)
    ],
    colours: Annotated[
        Path | None,
        typer.Option(help="Colour table, as glovecal camera colours makes it.", exists=True, dir_okay=False),
    ] = None,
    calibration: Annotated[
        Path | None,
        typer.Option(help="As glovecal camera calibrate makes it.", exists=True, dir_okay=False),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Keep a colour table, a calibration or both with the service, for cameras started over REST."""
    given = {"colours": colours, "calibrations": calibration}
    if not any(given.values()):
        raise typer.BadParameter("give --colours FILE, --calibration FILE or both")
    known = {}
    with connect() as service:
        for kind, file in given.items():
            if file is not None:
                known = service.put(f"/camera-files/{kind}/{name}", {"upload": service.upload(file)})
    if as_json:
        print_json(known)
        return
    for kind in given:
        out.print(f"{kind}: {', '.join(known[kind]) or 'none'}")


def import_video(
    file: Annotated[
        Path,
        typer.Argument(
            help="Of a phone or a camera: .mp4, .mov, .m4v, .mkv, .webm or .avi.", exists=True, dir_okay=False
        ),
    ],
    name: Annotated[
        str | None, typer.Option(help="To keep it under: a-z, 0-9, _ and -. Default: its own.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Bring a phone's video to the service, where the page Cameras plays it; one of that name is replaced.

    The times of its pictures are the file's own, also where their rate varies; what is taken for them where
    there are none is said.
    """
    with connect() as service:
        body = {"upload": service.upload(file), "filename": file.name}
        kept = read(CameraVideo, service.put(f"/camera-files/videos/{name or video_name(file.name)}", body))
    if as_json:
        print_json(kept.model_dump())
        return
    out.print(f"{kept.name}: {kept.pictures} pictures in {kept.seconds:.1f} s; {kept.times}.")
    out.print(
        "Next: the page Cameras plays it; angles of every picture: "
        f"glovecal camera estimates {as_typed(file)} --out FILE.npz"
    )


app = typer.Typer(help="A camera and the printed colour glove.", no_args_is_help=True)
app.command("sheets")(sheets)
app.command("calibrate")(calibrate)
app.command("colours")(colours)
app.command("store")(store)
app.command("patterns")(patterns)
app.command("import")(import_video)
app.command("prepare")(with_tracking(prepare, "stage", "colours", "calibration", "shape", "mirrored"))
app.command("shape")(with_tracking(shape, "stage", "shape"))
app.command("track")(with_tracking(track))
app.command("estimates")(with_tracking(estimates))
