"""Files for their owner only: what a glove records tells about a person.

On Windows, whose files have no such modes, nothing here has an effect: there a user's own folder closes what
lies in it to others.
"""

from __future__ import annotations

import os
import stat
from contextlib import suppress
from pathlib import Path

from glovecal_client.installation import IMAGE, INSTALLED_BY
from glovecal_client.operating_system import HAS_FILE_MODES

OTHERS = stat.S_IRWXG | stat.S_IRWXO
PRIVATE_FOLDER = 0o700

_mask_at_start: int | None = None


def keep_private() -> None:
    """Files and folders that this process and its children make from now on are 600 and 700."""
    global _mask_at_start
    mask = os.umask(OTHERS)
    if _mask_at_start is None:
        _mask_at_start = mask


def make_ordinary(file: Path) -> None:
    """Give a file that the user asked for by name, such as a report, what the umask at the start gives."""
    if _mask_at_start is not None:
        file.chmod(0o666 & ~_mask_at_start)


def open_private(path: str, flags: int) -> int:
    """``opener`` for ``open`` and ``FileIO``: a new file is 600, whatever the umask."""
    return os.open(path, flags, 0o600)


class OpenToOthers(PermissionError):
    """A secret that other users of the computer may read; the sentence says how to close it."""


def read_secret(file: Path, most: int) -> bytes:
    """At most so many bytes. Raises OSError, and of these OpenToOthers.

    systemd shows a credential as readable for its group: an access list lets one user read it. An image has
    one user, and how readable a secret is shown there is for its engine to say.
    """
    with file.open("rb") as stream:
        mode = stat.S_IMODE(os.fstat(stream.fileno()).st_mode)
        content = stream.read(most)
    is_credential = str(file.parent) == os.environ.get("CREDENTIALS_DIRECTORY")
    is_alone = os.environ.get(INSTALLED_BY) == IMAGE
    if HAS_FILE_MODES and not is_alone and mode & (stat.S_IRWXO if is_credential else OTHERS):
        raise OpenToOthers(f"others on this computer may read it (its mode is {mode:o}): chmod 600 {file}")
    return content


def make_private(place: Path) -> int:
    """Take the rights of other users off a file, or a folder and all in it; how many had some.

    Links are neither followed nor changed. What lies in a folder that is closed already is out of others'
    reach and not looked at. The folder itself comes last, so that a repair that was killed is done again.
    Raises PermissionError for what another user owns.
    """
    if not _is_open(place):
        return 0
    count = 0
    for folder, _, files in os.walk(place, topdown=False):
        for path in (*(Path(folder, file) for file in files), Path(folder)):
            count += _close(path)
    return count + _close(place)


def _is_open(path: Path) -> bool:
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return False
    return HAS_FILE_MODES and bool(mode & OTHERS) and not stat.S_ISLNK(mode)


def _close(path: Path) -> bool:
    with suppress(FileNotFoundError):  # another process's temporary file
        if _is_open(path):
            path.chmod(stat.S_IMODE(path.lstat().st_mode) & ~OTHERS)
            return True
    return False
