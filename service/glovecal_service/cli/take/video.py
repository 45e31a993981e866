"""``glovecal take video``: what was filmed beside a take, to be looked at in the studio."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from glovecal_service.cli.take.rows import named_take
from glovecal_service.cli.terminal.connection import connect


def video(
    take: Annotated[str, typer.Argument(help="Name or id.")],
    file: Annotated[
        Path, typer.Argument(exists=True, dir_okay=False, help="The .mkv that glovecal record --video wrote.")
    ],
) -> None:
    """Show a video beside a take in the studio. glovecal record --video does so by itself."""
    from glovecal_service.cli.glove.beside import attach_video

    with connect() as service:
        attach_video(service, file, [named_take(service, take).id])
