"""Folders for files that are made to be sent: in memory where what is kept is encrypted, so that nothing of
them reaches the disk.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from glovecal_client.encryption.kept_file import is_encrypting
from glovecal_service.operating_system import folder_in_memory

PREFIX = "glovecal-answer-"
LEAST_FREE_BYTES = 1_000_000_000
"""In memory; a container gives 64 MB unless it is told otherwise."""
ABANDONED_AFTER_S = 3600.0
"""So old a folder belongs to a process that was killed."""


def temporary_folder() -> tempfile.TemporaryDirectory[str]:
    """Removed by its ``cleanup`` or at the end of ``with``."""
    memory = folder_in_memory() if is_encrypting() else None
    if memory is not None and shutil.disk_usage(memory).free < LEAST_FREE_BYTES:
        memory = None
    return tempfile.TemporaryDirectory(prefix=PREFIX, dir=memory)


def sweep_temporary_folders() -> None:
    """Remove what killed processes of this user left in memory."""
    memory = folder_in_memory()
    for leftover in [] if memory is None else Path(memory).glob(f"{PREFIX}*"):
        with suppress(OSError):
            if time.time() - leftover.stat().st_mtime > ABANDONED_AFTER_S:
                shutil.rmtree(leftover)
