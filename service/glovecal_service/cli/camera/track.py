"""``glovecal camera track``: poses of a hand in the colour glove, from a camera, a video or drawings."""

from __future__ import annotations

import threading
from enum import Enum
from typing import Annotated

import typer

from glovecal_service.cli.camera.tracking_options import TrackingOptions
from glovecal_service.cli.glove.capture import GloveOption
from glovecal_service.cli.terminal.options import DEFAULT_ZENOH, Site, Zenoh
from glovecal_service.cli.terminal.printing import EXPECTED, err, exit_code_of, sentence_of


class Kept(Enum):
    pictures = "pictures"
    labels = "labels"
    nothing = "nothing"


def track(
    source: Annotated[
        str,
        typer.Argument(
            help="camera:NUMBER (0 is the first), video:FILE, labels:FILE.labels, rendered (simulated).",
            show_default=False,
        ),
    ],
    glove: GloveOption,
    tracking: TrackingOptions,
    keep: Annotated[
        Kept,
        typer.Option(
            help="pictures: all as they came (FFV1, tens of GB an hour); labels: of every picture tracked, "
            "about 0.5 GB an hour, can be tracked again and shows no face."
        ),
    ] = Kept.labels,
    connect: Zenoh = DEFAULT_ZENOH,
    site: Site = "lab",
) -> None:
    """Track the colour glove and publish its poses like any glove's. Ctrl-C stops it.

    The first start builds the pose database, in about a minute; glovecal camera prepare does so beforehand.
    """
    from glovecal_client.program import leave_at_once, say, stopped_by_signals
    from glovecal_service.camera.camera_settings import CameraSettings
    from glovecal_service.camera.process import run_camera

    settings = CameraSettings(
        source, glove, site, connect, tracking.subject, keep.value, **tracking.settings()
    )
    stop = threading.Event()
    try:
        with stopped_by_signals(stop, outlives_terminal=True):
            say(str(run_camera(settings, stop)))
        code = 0
    except EXPECTED as error:
        err.print(sentence_of(error), style="red")
        code = exit_code_of(error)
    leave_at_once(code)  # all is closed; a driver's thread may hang
