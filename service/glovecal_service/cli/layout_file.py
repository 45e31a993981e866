"""A layout given on the command line: the name of a stored one, or a file that is stored first."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from glovecal_models.errors import BadInput
from glovecal_models.names import check_identifier

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient


def layout_named(service: RestClient, layout: str | None) -> str | None:
    """The layout's name; a file is stored under the name in it. Raises typer.BadParameter for neither."""
    if layout is None:
        return None
    if Path(layout).is_file():
        return service.add_layout(Path(layout))
    if Path(layout).suffix in (".toml", ".json") or "/" in layout:
        raise typer.BadParameter(f"there is no layout file {layout!r}")
    try:
        return check_identifier(layout, "layout")
    except BadInput as error:
        raise typer.BadParameter(str(error)) from error
