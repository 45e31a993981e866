"""Where a verb's answers come from: the service at GLOVECAL_URL, or one inside this process."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient


@contextmanager
def connect() -> Iterator[RestClient]:
    """A REST client. Without GLOVECAL_URL the service is mounted in this process on GLOVECAL_DATA.

    The heavy packages are imported here, so that ``glovecal --help`` answers at once.
    """
    url = os.environ.get("GLOVECAL_URL")
    if url:
        from glovecal_client.rest import RestClient

        with RestClient(url) as client:
            yield client
        return
    from glovecal_service.rest.in_process import in_process_client
    from glovecal_service.settings import Settings

    with in_process_client(Settings()) as client:
        yield client
