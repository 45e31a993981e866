"""``glovecal camera track``: poses of a hand in the colour glove, from a camera, a video or drawings."""

from __future__ import annotations

import sys
import threading
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from glovecal_service.cli.glove.capture import GloveOption
from glovecal_service.cli.terminal import connection
from glovecal_service.cli.terminal.options import DEFAULT_ZENOH, Site, Zenoh, subject_named
from glovecal_service.cli.terminal.printing import out


class Stage(Enum):
    nearest = "nearest"
    blend = "blend"
    ik = "ik"
    dense = "dense"


class Kept(Enum):
    pictures = "pictures"
    labels = "labels"
    nothing = "nothing"


class Hand(Enum):
    right = "right"
    left = "left"


def track(
    source: Annotated[
        str,
        typer.Argument(
            help="camera:NUMBER (0 is the first), video:FILE.mkv, labels:FILE.labels, rendered (simulated).",
            show_default=False,
        ),
    ],
    glove: GloveOption,
    stage: Annotated[
        Stage, typer.Option(help="How far each picture is followed; each stage starts from the one before.")
    ] = Stage.dense,
    keep: Annotated[
        Kept,
        typer.Option(
            help="pictures: all as they came (FFV1, tens of GB an hour); labels: of every picture tracked, "
            "about 0.5 GB an hour, can be tracked again and shows no face."
        ),
    ] = Kept.labels,
    colours: Annotated[
        Path | None,
        typer.Option(help="Colour table of this glove and light. Default: learned on rendered photographs."),
    ] = None,
    calibration: Annotated[
        Path | None, typer.Option(help="The camera, as glovecal camera calibrate makes it.")
    ] = None,
    subject: Annotated[
        str | None,
        typer.Option(help="Who wears it: with the sizes that were measured.", callback=subject_named),
    ] = None,
    hand: Annotated[
        Hand | None, typer.Option(help="The hand that wears it. Default: the subject's, else the right one.")
    ] = None,
    entries: Annotated[
        int, typer.Option(min=300, max=1_000_000, help="Of the pose database; the paper has 100,000.")
    ] = 20_000,
    clips: Annotated[
        int,
        typer.Option(min=3, max=1000, help="Rendered clips from which the stated deviations are learned."),
    ] = 36,
    connect: Zenoh = DEFAULT_ZENOH,
    site: Site = "lab",
    data: Annotated[
        Path, typer.Option(envvar="GLOVECAL_DATA", help="Folder of the database and of what is kept.")
    ] = Path("glovecal-data"),
) -> None:
    """Track the colour glove and publish its poses like any glove's. Ctrl-C stops it.

    The first start builds the pose database and takes a minute or two.
    """
    from glovecal_client.capture.command import stopped_by_signals
    from glovecal_service.camera.camera_settings import CameraSettings
    from glovecal_service.camera.process import run_camera

    sizes_mm, own_hand = _worn_by(subject)
    settings = CameraSettings(
        source, glove, data, site, connect, subject, own_hand if hand is None else hand.value, stage.value,
        keep.value, colours, calibration, entries=entries, clips=clips, sizes_mm=sizes_mm,
    )  # fmt: skip
    stop = threading.Event()
    with stopped_by_signals(stop):
        summary = run_camera(settings, stop)
    sys.stderr.flush()
    out.print(str(summary))


def _worn_by(subject: str | None) -> tuple[dict[str, float], str]:
    """What was measured of the subject's hand, mm, and which hand it is."""
    if subject is None:
        return {}, Hand.right.value
    with connection.connect() as client:
        known = client.get(f"/subjects/{subject}")
    return known["dimensions"], known["hand"]
