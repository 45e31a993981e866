"""A data folder that other users of the computer could look into is closed to them when it is opened."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path

from glovecal_client.private_files import make_private
from glovecal_service.store.data_folder_lock import LOCK, WHO

FOLDERS = frozenset(
    {"artifacts", "cameras", "capture", "films", "fits", "owners", "recordings", "uploads", "videos"}
)
_log = logging.getLogger("glovecal.store")


def close_to_others(data: Path, database_files: Sequence[Path]) -> None:
    """Files 600, folders 700; the log says so where they were not.

    ``data`` itself, resolved, is closed if there is nothing in it but ours: it may be a folder, such as a
    home, that others have to pass. What another user owns stays as it is, with a warning.
    """
    entries = list(data.iterdir())
    ours = [entry for entry in entries if entry.name in (*FOLDERS, LOCK, WHO) or entry in database_files]
    places = [data] if len(ours) == len(entries) else ours
    closed = 0
    for place in (*places, *database_files):
        try:
            closed += make_private(place)
        except PermissionError as error:
            _log.warning("other users may read %s: its permissions cannot be changed (%s)", place, error)
    if closed:
        _log.warning("other users could read %d files and folders of %s; that is over", closed, data)
