"""``glovecal worker``: lend this computer's processors to a service elsewhere."""

from __future__ import annotations

from typing import Annotated

import typer


def worker(
    processes: Annotated[
        int | None,
        typer.Option(min=1, max=256, help="Training processes, one thread each. Default: GLOVECAL_WORKERS."),
    ] = None,
) -> None:
    """Train for a service on another computer, until Ctrl-C.

    GLOVECAL_SITE_FILE names this computer's file, made at the service: glovecal site add NAME --as worker.
    It shares no folder with the service, and needs the same version of Glovecal.
    """
    from glovecal_client.program import say
    from glovecal_client.site.member import SITE_FILE, site_file
    from glovecal_service.cli.terminal.connection import settings_of_environment
    from glovecal_service.cli.terminal.printing import Refusal
    from glovecal_service.jobs.remote_worker import RemoteWorker

    file = site_file()
    if file is None:
        raise Refusal(
            f"{SITE_FILE} names no file; make one at the service with `glovecal site add NAME --as worker`, "
            "and copy it to this computer"
        )
    RemoteWorker(file, processes or settings_of_environment().workers or 1, say).run()
