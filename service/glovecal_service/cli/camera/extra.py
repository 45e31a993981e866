"""What verbs say where the libraries of the camera are not installed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from glovecal_service.camera.packages import camera_not_installed
from glovecal_service.cli.terminal.refusal import Refusal


@contextmanager
def camera_extra() -> Iterator[None]:
    """For imports of the colour glove. Raises Refusal that says how to install what is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise Refusal(camera_not_installed("the colour glove")) from error
