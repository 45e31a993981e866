"""The last four bytes of every message: the CRC-32 (zlib, IEEE 802.3) of all bytes before, little-endian."""

from __future__ import annotations

import struct
import zlib

from glovecal_client.errors import WireError

CHECKSUM_BYTES = 4
_CHECKSUM = struct.Struct("<I")


def sealed(body: bytes) -> bytes:
    """``body`` with its checksum appended."""
    return body + _CHECKSUM.pack(zlib.crc32(body))


def check_seal(message: bytes, what: str) -> None:
    """Raise WireError unless the last four bytes are the checksum of the others."""
    at = len(message) - CHECKSUM_BYTES
    (stated,) = _CHECKSUM.unpack_from(message, at)
    found = zlib.crc32(memoryview(message)[:at])
    if stated != found:
        raise WireError(f"{what}: damaged, its bytes have CRC {found:08x} but it states {stated:08x}")
