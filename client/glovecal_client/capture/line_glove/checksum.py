"""Checksums that lines of text carry, by the name a description gives them.

``xor`` is NMEA 0183's, ``sum`` adds bytes modulo 256, ``crc16`` is CRC-16/CCITT-FALSE (polynomial 0x1021,
start 0xFFFF), ``crc32`` is zlib's.
"""

from __future__ import annotations

import binascii
import zlib
from collections.abc import Callable
from functools import reduce
from operator import xor


def _xor(data: bytes) -> int:
    return reduce(xor, data, 0)


def _sum(data: bytes) -> int:
    return sum(data) & 0xFF


def _crc16(data: bytes) -> int:
    return binascii.crc_hqx(data, 0xFFFF)


CHECKSUMS: dict[str, Callable[[bytes], int]] = {
    "xor": _xor,
    "sum": _sum,
    "crc16": _crc16,
    "crc32": zlib.crc32,
}
