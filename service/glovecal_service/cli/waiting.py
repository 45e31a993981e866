"""Waiting for a job, with a progress bar on a terminal and silence elsewhere."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from glovecal_service.cli.printing import err

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient


def wait_for_job(service: RestClient, job: str, *, quiet: bool = False) -> dict[str, Any]:
    """The finished job. Raises ServiceError when it failed; Ctrl-C cancels the job and raises on."""
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))
    shown = err.is_terminal and not quiet
    with Progress(*columns, TimeElapsedColumn(), console=err, transient=True, disable=not shown) as progress:
        bar = progress.add_task("waiting for a worker", total=1.0)

        def show(document: dict[str, Any]) -> None:
            sentence = document["sentence"] or "waiting for a worker"
            progress.update(bar, completed=document["fraction"], description=sentence)

        try:
            return service.wait_for_job(job, progress=show)
        except KeyboardInterrupt:
            service.post(f"/jobs/{job}/cancel")
            raise
