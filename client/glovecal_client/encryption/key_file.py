"""The key that files on disk are encrypted with: one file, named by ``GLOVECAL_ENCRYPTION_KEY_FILE``.

A data folder remembers the id of its key, never the key, in ``encryption-key-id``: with another key, or with
none, nothing of it is opened.
"""

from __future__ import annotations

import hashlib
import hmac
import os
import re
import secrets
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

from glovecal_client.errors import BadEncryptionKey, reason_of
from glovecal_client.installation import not_installed
from glovecal_client.operating_system import move_over, sync_file
from glovecal_client.private_files import PRIVATE_FOLDER, OpenToOthers, open_private, read_secret

KEY_FILE = "GLOVECAL_ENCRYPTION_KEY_FILE"
"""The environment variable with the path of the key's file."""
KEY_ID_FILE = "encryption-key-id"
"""Of a data folder: the id of the key that its files are encrypted with, in hexadecimal digits."""
FORMAT = "glovecal-encryption-key-1"
MADE_BY = "glovecal encryption make-key FILE"
_CONTENT = re.compile(rf"{FORMAT}\n([0-9a-f]{{64}})\n?\Z")
_LARGEST_FILE = 4096


@dataclass(frozen=True)
class EncryptionKey:
    """``repr`` shows no secret."""

    file: Path
    secret: bytes = field(repr=False)
    """32 random bytes."""

    @property
    def id(self) -> bytes:
        """16 bytes that tell one key from another, and nothing of it."""
        return hmac.digest(self.secret, b"glovecal key id", hashlib.sha256)[:16]

    def derived(self, label: bytes) -> bytes:
        """64 bytes for one purpose, unrelated to those of any other ``label``."""
        return hmac.digest(self.secret, b"glovecal derived key\0" + label, hashlib.sha512)


def key_of_environment() -> EncryptionKey | None:
    """The key that is named, None where nothing is set; read once by each process. Raises
    BadEncryptionKey."""
    named = os.environ.get(KEY_FILE)
    return _read_once(Path(named).absolute()) if named else None


def make_key_file(file: Path) -> EncryptionKey:
    """Write a new random key, for its owner only. Raises BadEncryptionKey where ``file`` is there already or
    cannot be written: a key is never overwritten."""
    secret = secrets.token_bytes(32)
    try:
        with open(file, "x", encoding="ascii", opener=open_private) as stream:
            stream.write(f"{FORMAT}\n{secret.hex()}\n")
            stream.flush()
            sync_file(stream)
    except FileExistsError as error:
        raise BadEncryptionKey(
            f"{file} exists already and is not overwritten: what was encrypted with a key can be read with "
            "that key alone. Choose another file"
        ) from error
    except OSError as error:
        raise BadEncryptionKey(f"the key cannot be written to {file}: {reason_of(error)}") from error
    return EncryptionKey(file, secret)


def settle_encryption(data: Path) -> EncryptionKey | None:
    """Hold the key that is named against the data folder, which remembers the first one for ever.

    To be called before anything in ``data`` is opened. Raises BadEncryptionKey: the key's file is missing,
    lies in ``data``, is readable for others or is none; the folder is encrypted with another key, or with one
    and none is named; the package is not installed.
    """
    key = key_of_environment()
    remembered = data / KEY_ID_FILE
    try:
        known = remembered.read_text(encoding="ascii").strip()
    except (FileNotFoundError, NotADirectoryError):
        known = ""
    except (OSError, UnicodeDecodeError) as error:
        raise BadEncryptionKey(f"{remembered} cannot be read: {reason_of(error)}") from error
    if key is None:
        if known:
            raise BadEncryptionKey(
                f"the data folder {data} is encrypted with the key {known[:8]}: name its file in {KEY_FILE}. "
                "Nothing was changed"
            )
        return None
    if key.file.resolve().is_relative_to(data.resolve()):
        raise BadEncryptionKey(
            f"the key {key.file} lies inside the data folder {data}, so whoever takes the folder has both: "
            f"move it elsewhere and name its new place in {KEY_FILE}"
        )
    require_cipher()
    if known and known != key.id.hex():
        raise BadEncryptionKey(
            f"the data folder {data} is encrypted with the key {known[:8]}, and {key.file} holds the key "
            f"{key.id.hex()[:8]}: name the right file in {KEY_FILE}. Nothing was changed"
        )
    if not known:
        _remember(remembered, key)
    return key


def require_cipher() -> None:
    """Raises BadEncryptionKey where the package that encrypts is not installed."""
    if find_spec("cryptography") is None:
        raise BadEncryptionKey(not_installed(f"encryption ({KEY_FILE})", "cryptography"))


def _remember(place: Path, key: EncryptionKey) -> None:
    unnamed = place.with_name(f"{place.name}.{secrets.token_hex(4)}")
    try:
        place.parent.mkdir(mode=PRIVATE_FOLDER, parents=True, exist_ok=True)
        with open(unnamed, "x", encoding="ascii", opener=open_private) as stream:
            stream.write(f"{key.id.hex()}\n")
            stream.flush()
            sync_file(stream)
        move_over(unnamed, place, durably=True)
    except OSError as error:
        unnamed.unlink(missing_ok=True)
        raise BadEncryptionKey(f"{place} cannot be written: {reason_of(error)}") from error


@lru_cache(maxsize=8)
def _read_once(file: Path) -> EncryptionKey:
    try:
        content = read_secret(file, _LARGEST_FILE)
    except OpenToOthers as error:
        raise BadEncryptionKey(f"the key {file}: {error}, and make a new one if somebody read it") from error
    except OSError as error:
        raise BadEncryptionKey(
            f"the key {file} that {KEY_FILE} names cannot be read: {reason_of(error)}. Nothing was changed; "
            f"if there is no key yet, make one: {MADE_BY}"
        ) from error
    key = _CONTENT.match(content.decode("ascii", "replace"))
    if key is None:
        raise BadEncryptionKey(
            f"{file}, which {KEY_FILE} names, is no key of Glovecal: it must hold the line {FORMAT} and one "
            f"of 64 hexadecimal digits. Make one: {MADE_BY}"
        )
    return EncryptionKey(file, bytes.fromhex(key[1]))
