"""``glovecal serve``: the service."""

from __future__ import annotations


def serve() -> None:
    """Run the service: zenoh router, real-time prediction, recorder and REST. Ctrl-C stops it.

    Settings are environment variables: GLOVECAL_DATA, GLOVECAL_HOST, GLOVECAL_PORT, GLOVECAL_ZENOH,
    GLOVECAL_SITE, GLOVECAL_DATABASE.
    """
    import sys

    from glovecal_service.serve import serve as run
    from glovecal_service.settings import Settings

    sys.exit(run(Settings()))
