"""``glovecal serve``: the service."""

from __future__ import annotations


def serve() -> None:
    """Run the service: zenoh router, real-time prediction, recorder and REST. Ctrl-C stops it.

    Settings are environment variables: GLOVECAL_DATA, GLOVECAL_HOST, GLOVECAL_PORT, GLOVECAL_ZENOH,
    GLOVECAL_SITE, GLOVECAL_DATABASE, GLOVECAL_ARTIFACTS, GLOVECAL_WORKERS, GLOVECAL_WORKERS_IDLE_S,
    GLOVECAL_SCHEDULER (with GLOVECAL_SCHEDULER_CA, GLOVECAL_SCHEDULER_CERTIFICATE, GLOVECAL_SCHEDULER_KEY),
    GLOVECAL_UPLOAD_LIMIT_MB.
    """
    import sys

    from glovecal_service.cli.connection import settings_of_environment
    from glovecal_service.serve import serve as run

    sys.exit(run(settings_of_environment()))
