"""Files that show or measure a person: encrypted while ``GLOVECAL_ENCRYPTION_KEY_FILE`` names a key.

Whoever reads or writes such a file does it here and need not know which it is: a file that was written
without a key stays readable when there is one, and a frame log may have been packed meanwhile.
"""

from __future__ import annotations

import hashlib
import io
import os
import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import FileIO
from pathlib import Path
from typing import IO, BinaryIO, Literal, cast

from glovecal_client import packed_log
from glovecal_client.encryption.encrypted_file import (
    GROWING,
    HEADER_BYTES,
    WHOLE,
    DecryptingReader,
    EncryptingWriter,
    is_encrypted,
)
from glovecal_client.encryption.key_file import key_of_environment
from glovecal_client.errors import DamagedFile
from glovecal_client.operating_system import move_over, sync_file
from glovecal_client.private_files import open_private

GrowingFile = FileIO | EncryptingWriter
"""Written without a buffer; what was written is with the operating system."""
UNFINISHED = ".encrypting"
Opener = Callable[[str, int], int]


def is_kept_encrypted(path: Path) -> bool:
    """For libraries that read a path. Raises OSError, BadEncryptionKey."""
    with path.open("rb") as file:
        return is_encrypted(file.read(HEADER_BYTES), key_of_environment())


def is_encrypting() -> bool:
    """Whether files that are written now are encrypted. Raises BadEncryptionKey."""
    return key_of_environment() is not None


def open_kept(path: Path) -> BinaryIO:
    """Read a file. Raises OSError; of these BadEncryptionKey, and DamagedFile, which reading raises too."""
    file = _decrypted_file(path)
    try:
        begins = file.read(len(packed_log.MAGIC))
        file.seek(0)
        if begins != packed_log.MAGIC:
            return file
        return cast("BinaryIO", io.BufferedReader(packed_log.PackedReader(file, path.name), 1 << 16))
    except BaseException:
        file.close()
        raise


def _decrypted_file(path: Path) -> BinaryIO:
    file = FileIO(path, "rb")
    try:
        key = key_of_environment()
        if not is_encrypted(file.read(HEADER_BYTES), key):
            file.seek(0)
            return io.BufferedReader(file)
        reader = DecryptingReader(file, key, path.name)
        return cast("BinaryIO", io.BufferedReader(reader, 1 << 16))
    except BaseException:
        file.close()
        raise


def open_kept_text(path: Path) -> IO[str]:
    """As ``open_kept``, UTF-8 with lines as they are."""
    return io.TextIOWrapper(open_kept(path), encoding="utf-8", newline="")


def read_kept(path: Path, most: int = -1) -> bytes:
    """All of a file, or its first ``most`` bytes. Raises as ``open_kept``."""
    with open_kept(path) as file:
        return file.read(most)


def create_whole(path: Path) -> BinaryIO:
    """A new file, written once: who reads it later is told where its end is missing. Raises FileExistsError,
    OSError, BadEncryptionKey."""
    key = key_of_environment()
    if key is None:
        return path.open("xb")
    return cast(
        "BinaryIO", _created(FileIO(path, "xb"), lambda file: EncryptingWriter.create(file, key, WHOLE))
    )


def finish_file(file: BinaryIO) -> None:
    """Write the end of a file of ``create_whole`` and bring all to the disk. Raises OSError."""
    if isinstance(file, EncryptingWriter):
        file.finish()
    file.flush()
    sync_file(file)


def create_growing(path: Path, mode: Literal["xb", "wb"] = "xb", opener: Opener | None = None) -> GrowingFile:
    """A new file that is readable up to its last write, whatever ends the writer. Raises FileExistsError,
    OSError, BadEncryptionKey."""
    key = key_of_environment()
    file = FileIO(path, mode, opener=opener)
    return file if key is None else _created(file, lambda file: EncryptingWriter.create(file, key, GROWING))


def resume_growing(path: Path, end: int) -> GrowingFile:
    """Go on after ``end`` bytes of its content. Raises OSError, DamagedFile, BadEncryptionKey."""
    key = key_of_environment()
    file = FileIO(path, "r+b")
    if is_packed(path):
        file.close()
        raise DamagedFile(f"{path.name} is packed: nobody writes to it any more")
    if not is_encrypted(file.read(HEADER_BYTES), key):
        file.seek(end)
        return file
    return _created(file, lambda file: EncryptingWriter.resume(file, key, path.name))


def _created(file: FileIO, make: Callable[[FileIO], EncryptingWriter]) -> EncryptingWriter:
    try:
        return make(file)
    except BaseException:
        file.close()
        raise


def cut_file(path: Path, end: int) -> int:
    """Cut a growing file back to ``end`` bytes of its content, where a write ended; how many bytes went.

    They are kept as they lay, encrypted or not, in ``NAME.cut``. Raises OSError, DamagedFile,
    BadEncryptionKey.
    """
    key = key_of_environment()
    if is_packed(path):
        return 0  # what was damaged when it was packed is in it
    with path.open("r+b") as file:
        if is_encrypted(file.read(HEADER_BYTES), key):
            end = DecryptingReader(file, key, path.name, closes=False).boundary(end)
        file.seek(end)
        tail = file.read()
        if tail:
            with path.with_name(path.name + ".cut").open("ab") as kept:
                kept.write(tail)
            file.truncate(end)
    return len(tail)


def encrypt_file(path: Path, *, grows: bool) -> bool:
    """Put an encrypted file in the place of a plain one, with its times; False for one that is encrypted.

    Killed at any moment, ``path`` is the one or the other; what is unfinished has the suffix ``UNFINISHED``.
    Nobody may be writing to it. Raises OSError, BadEncryptionKey.
    """
    if is_kept_encrypted(path):
        return False
    with (
        _in_place_of(path) as unfinished,
        path.open("rb") as plain,
        _created_as(unfinished, grows=grows) as file,
    ):
        shutil.copyfileobj(plain, file, 1 << 20)
        finish_file(file)
    return True


def is_packed(path: Path) -> bool:
    """Raises OSError, BadEncryptionKey, DamagedFile."""
    with _decrypted_file(path) as file:
        return file.read(len(packed_log.MAGIC)) == packed_log.MAGIC


def pack_log(path: Path) -> bool:
    """Put a packed frame log in the place of one that nobody writes to any more, with its times; False for
    one that is packed already.

    It is read back before; killed at any moment, ``path`` is the one or the other. Raises OSError,
    BadEncryptionKey, DamagedFile.
    """
    if is_packed(path):
        return False
    with _in_place_of(path) as unfinished, _decrypted_file(path) as log:
        with create_whole(unfinished) as file:
            for block in packed_log.packed_blocks(log):
                file.write(block)
            finish_file(file)
        log.seek(0)
        if _sha256(log) != _read_back(unfinished):
            raise DamagedFile(f"{path.name} cannot be packed: it is not read back as it is")
    return True


@contextmanager
def _in_place_of(path: Path) -> Iterator[Path]:
    """A file that takes the place and the times of ``path`` once it is whole, and goes if that fails."""
    about, unfinished = path.stat(), path.with_name(f"{path.name}.{secrets.token_hex(4)}{UNFINISHED}")
    try:
        yield unfinished
        os.utime(unfinished, ns=(about.st_atime_ns, about.st_mtime_ns))
        move_over(unfinished, path, durably=True)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise


def _read_back(path: Path) -> str:
    with open_kept(path) as file:
        return _sha256(file)


def _sha256(file: BinaryIO) -> str:
    digest = hashlib.sha256()
    while part := file.read(1 << 20):
        digest.update(part)
    return digest.hexdigest()


def _created_as(path: Path, *, grows: bool) -> BinaryIO:
    return cast("BinaryIO", create_growing(path, opener=open_private)) if grows else create_whole(path)


def encrypted(content: bytes) -> bytes:
    """What is to be written for ``content``. Raises BadEncryptionKey."""
    key = key_of_environment()
    if key is None:
        return content
    held = io.BytesIO()
    with EncryptingWriter.create(held, key, WHOLE) as file:
        file.write(content)
        file.finish()
        return held.getvalue()


def decrypted(content: bytes, name: str) -> bytes:
    """Inverse of ``encrypted``; the same where it is not. Raises DamagedFile, BadEncryptionKey."""
    key = key_of_environment()
    if not is_encrypted(content[:HEADER_BYTES], key):
        return content
    return DecryptingReader(io.BytesIO(content), key, name).readall()
