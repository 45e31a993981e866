"""Sources of pictures for a camera glove: those of the recording tool, label images, and a drawn glove."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from glovecal_client.errors import BadOption
from glovecal_client.pictures.label_file import LabelFilePictures
from glovecal_client.pictures.rendered import RenderedPictures
from glovecal_client.pictures.source import PictureSource, build_source
from glovecal_service.camera.rendered_glove import RATE_HZ, RenderedGlove

RENDERED = "rendered"


def camera_source(text: str, glove: Callable[[], RenderedGlove]) -> PictureSource:
    """The source written as ``text``, not yet opened; ``glove`` is drawn for ``rendered``.

    Raises BadOption; DeviceError without OpenCV.
    """
    kind, _, argument = text.partition(":")
    if text == RENDERED:
        return RenderedPictures(glove().draw, RATE_HZ, name=RENDERED)
    if kind == "labels" and argument:
        return LabelFilePictures(Path(argument))
    try:
        return build_source(text)
    except BadOption as error:
        raise BadOption(f"{error}, or labels:FILE") from error
