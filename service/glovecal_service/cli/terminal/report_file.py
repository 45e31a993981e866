"""The page with pictures that comparing verbs write."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glovecal_service.cli.terminal.printing import err, out
from glovecal_service.cli.terminal.writing import write_whole

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

Report = Annotated[
    Path | None, typer.Option("--report", help="Write a page with pictures to this .html file.")
]


def fetch_report(service: RestClient, models: Sequence[str], takes: Sequence[dict[str, Any]]) -> bytes:
    """The first of ``models`` looked at closely, the others beside it, against rows of ``GET /takes``."""
    body = {"takes": [row["id"] for row in takes], "beside": list(models[1:])}
    return service.page(f"/models/{models[0]}/report", body).encode()


def fetch_job_report(service: RestClient, job: str) -> bytes:
    """The page of a finished job that has one."""
    return service.download(f"/jobs/{job}/report")


def write_report(file: Path, page: bytes, *, as_json: bool) -> None:
    """Before anything is printed, since whoever reads that may stop reading (``| head``).

    Says so where it does not get into the JSON.
    """
    write_whole({file: page}, tell=err if as_json else out)
