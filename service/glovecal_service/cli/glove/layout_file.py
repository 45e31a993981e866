"""A layout given on the command line: the name of a stored one, or a file that is stored first."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from glovecal_client.errors import ServiceError
from glovecal_models.errors import BadInput
from glovecal_models.names import check_identifier
from glovecal_service.cli.terminal.refusal import REFUSED, Refusal, exit_code_of, sentence_of

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient


def add_layout_file(service: RestClient, file: Path) -> str:
    """Store the layout in a TOML or JSON file; its name. Raises Refusal that names the file."""
    from glovecal_client.rest import layout_name

    try:
        check_identifier(layout_name(file.read_bytes(), file), "name of the layout")
        return service.add_layout(file)
    except (BadInput, ServiceError) as error:
        if exit_code_of(error) != REFUSED:
            raise
        raise Refusal(f"{file}: {sentence_of(error)}") from error


def layout_named(service: RestClient, layout: str | None) -> str | None:
    """The layout's name; a file is stored under the name in it. Raises typer.BadParameter for neither."""
    if layout is None:
        return None
    if Path(layout).is_file():
        return add_layout_file(service, Path(layout))
    if Path(layout).suffix in (".toml", ".json") or "/" in layout:
        raise typer.BadParameter(f"there is no layout file {layout!r}")
    try:
        return check_identifier(layout, "layout")
    except BadInput as error:
        raise typer.BadParameter(str(error)) from error
