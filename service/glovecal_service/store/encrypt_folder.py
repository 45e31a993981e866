"""Encrypts what a data folder held before its key was named, file by file; killed, it goes on next time."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from glovecal_client.capture.log_folder import LogFolder
from glovecal_client.encryption.kept_file import UNFINISHED, encrypt_file, is_kept_encrypted
from glovecal_client.encryption.key_file import KEY_FILE, MADE_BY, settle_encryption
from glovecal_client.errors import BadEncryptionKey, CaptureRefused, ClientError, DamagedLog, reason_of
from glovecal_client.frame_log import cut_damaged_tail
from glovecal_client.keys import GloveKeys
from glovecal_client.pictures.video_file import SUFFIXES
from glovecal_service.settings import Settings
from glovecal_service.store.blobs import require_room
from glovecal_service.store.data_folder_lock import DataFolderLock

CAPTURE = ("capture", "simulated-glove/capture")
"""Folders with a folder each site, and in it each glove."""
LOGS, GROWING, WHOLE = (
    (".glvlog", ".glog"),
    (".mkv", ".labels", ".cut"),
    (
        ".zip",
        ".safetensors",
        *SUFFIXES[1:],
    ),
)
_SHA256 = re.compile(r"[0-9a-f]{64}\Z")


@dataclass
class EncryptedFolder:
    files: int = 0
    """Encrypted now."""
    size_bytes: int = 0
    problems: list[str] = field(default_factory=list)
    """What stays as it was, a sentence each."""


def encrypt_folder(settings: Settings, report: Callable[[Path], None] = lambda file: None) -> EncryptedFolder:
    """Encrypt what is plain in the data folder, with the key that is named; ``report`` hears each file.

    Logs of a glove that is being captured are left out and told. Raises FolderInUse while the service runs,
    BadEncryptionKey, StorageFull.
    """
    done, data = EncryptedFolder(), settings.data
    with DataFolderLock(data):
        if settle_encryption(data) is None:
            raise BadEncryptionKey(
                f"{KEY_FILE} names no key to encrypt with; make one outside the data folder with `{MADE_BY}`"
            )
        for leftover in data.rglob(f"*{UNFINISHED}"):
            leftover.unlink(missing_ok=True)
        folders = (
            settings.recordings_folder, settings.uploads_folder, settings.videos_folder,
            settings.films_folder, settings.fits_folder, settings.artifacts_folder,
            data / "cameras" / "kept", data / "cameras" / "videos",
        )  # fmt: skip
        for folder in folders:
            _encrypt(folder, done, report)
        for folder in _captures(data):
            try:
                logs = LogFolder(folder.parents[2], GloveKeys(folder.parent.name, folder.name))
            except (CaptureRefused, ClientError) as error:
                done.problems.append(reason_of(error))
                continue
            try:
                _encrypt(folder, done, report)
            finally:
                logs.close()
    return done


def _captures(data: Path) -> Iterator[Path]:
    for place in CAPTURE:
        yield from (folder for folder in sorted((data / place).glob("*/*")) if folder.is_dir())


def _encrypt(folder: Path, done: EncryptedFolder, report: Callable[[Path], None]) -> None:
    for log in folder.glob("*"):
        if log.suffix in LOGS and not is_kept_encrypted(log):
            with suppress(DamagedLog, OSError):  # is kept as it is
                cut_damaged_tail(log)  # an encrypted log does not go on in the middle of a block
    for file in sorted(folder.glob("*")):
        grows = file.suffix in (*LOGS, *GROWING)
        if not file.is_file() or not (grows or file.suffix in WHOLE or _SHA256.match(file.name)):
            continue
        require_room(folder)
        try:
            size = file.stat().st_size
            if encrypt_file(file, grows=grows):
                done.files, done.size_bytes = done.files + 1, done.size_bytes + size
                report(file)
        except OSError as error:
            done.problems.append(f"{file} is not encrypted: {reason_of(error)}")
