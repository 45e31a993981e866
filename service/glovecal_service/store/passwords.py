"""Passwords as they are kept: argon2id, with the memory and passes that RFC 9106 recommends where memory is
scarce.

One hash takes 64 MiB and some 0.2 s of a processor, outside Python's lock. It has one lane: with the four of
RFC 9106, OpenSSL 4.0.3 waits for ever as soon as two are made at once.
"""

from __future__ import annotations

import secrets
import unicodedata

from cryptography.exceptions import InvalidKey
from cryptography.hazmat.primitives.kdf.argon2 import Argon2id

from glovecal_models.errors import BadInput

LEAST_CHARACTERS = 12
MOST_CHARACTERS = 200
_PASSES, _PARALLELISM, _KIB = 3, 1, 64 * 1024
_SALT_BYTES, _HASH_BYTES = 16, 32
NOBODYS = f"$argon2id$v=19$m={_KIB},t={_PASSES},p={_PARALLELISM}${'A' * 22}${'A' * 43}"
"""A hash of no known password, for names that there are not: to check it takes as long."""


def check_password(password: str, name: str) -> None:
    """Raises BadInput for one that may not be used; it is never repeated."""
    count = len(_normalized(password))
    if not LEAST_CHARACTERS <= count <= MOST_CHARACTERS:
        raise BadInput(
            f"a password of {count} characters; give one of {LEAST_CHARACTERS} to {MOST_CHARACTERS}"
        )
    if _normalized(password).casefold() == name.casefold():
        raise BadInput("the password is the name; give another one")


def password_hash(password: str) -> str:
    """In PHC format, which has its parameters in it."""
    salt = secrets.token_bytes(_SALT_BYTES)
    made = Argon2id(salt=salt, length=_HASH_BYTES, iterations=_PASSES, lanes=_PARALLELISM, memory_cost=_KIB)
    return made.derive_phc_encoded(_bytes(password))


def is_password(password: str, hashed: str) -> bool:
    """Whether ``hashed`` was made from it."""
    try:
        Argon2id.verify_phc_encoded(_bytes(password), hashed)
    except InvalidKey:
        return False
    return True


def _normalized(password: str) -> str:
    """Keyboards spell one character in several ways."""
    return unicodedata.normalize("NFKC", password)


def _bytes(password: str) -> bytes:
    return _normalized(password).encode("utf-8", "surrogatepass")
