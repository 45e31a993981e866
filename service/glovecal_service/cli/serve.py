"""``glovecal serve``: the service."""

from __future__ import annotations

from typing import Annotated

import typer


def serve(
    smoke: Annotated[
        bool,
        typer.Option("--smoke", help="Start on free ports in a temporary folder and stop once ready."),
    ] = False,
    no_studio: Annotated[
        bool, typer.Option("--no-studio", help="REST only, without the pages below /studio.")
    ] = False,
) -> None:
    """Run the service: zenoh router, real-time prediction, recorder, REST and the studio. Ctrl-C stops it.

    Settings are environment variables: GLOVECAL_DATA, GLOVECAL_HOST, GLOVECAL_PORT, GLOVECAL_LOGIN,
    GLOVECAL_ALLOWED_HOSTS, GLOVECAL_PROXIES, GLOVECAL_OIDC_ISSUER (with GLOVECAL_OIDC_CLIENT_ID,
    GLOVECAL_OIDC_SECRET_FILE, GLOVECAL_OIDC_CLAIM, GLOVECAL_OIDC_ROLES, GLOVECAL_OIDC_NAME), GLOVECAL_ZENOH,
    GLOVECAL_ZENOH_PEERS, GLOVECAL_SITE, GLOVECAL_DATABASE, GLOVECAL_ARTIFACTS, GLOVECAL_REALTIME,
    GLOVECAL_RECORDERS, GLOVECAL_WORKERS, GLOVECAL_WORKERS_IDLE_S, GLOVECAL_WORKER_PORT,
    GLOVECAL_UPLOAD_LIMIT_MB, GLOVECAL_KEEP_DAYS, GLOVECAL_KEEP_JOBS_DAYS, GLOVECAL_LOG_NAMES,
    GLOVECAL_STUDIO. Secrets may stand in files: see Deploy.
    """
    import sys

    from glovecal_client.private_files import keep_private
    from glovecal_service.cli.terminal.connection import settings_of_environment
    from glovecal_service.serve import serve as run

    keep_private()
    if smoke:
        _smoke()
        return
    settings = settings_of_environment()
    sys.exit(run(settings.model_copy(update={"studio": False}) if no_studio else settings))


def _smoke() -> None:
    import tempfile
    from pathlib import Path

    from glovecal_service.cli.terminal.printing import out
    from glovecal_service.demo.processes import demo_place, running_service
    from glovecal_service.plain import read
    from glovecal_service.rest.glove.answer import Gloves

    with tempfile.TemporaryDirectory(prefix="glovecal-serve-") as folder:
        place = demo_place(Path(folder))
        with running_service(place) as service:
            gloves = len(read(Gloves, service.get("/gloves")).seen)
        out.print(f"Smoke test of serve: ready on {place.url} and {place.zenoh}, {gloves} gloves; stopped.")
