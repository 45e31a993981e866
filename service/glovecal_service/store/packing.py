"""Artifacts as they are kept: numbers of eight bytes lie byte beside byte, and are compressed.

Readings are whole counts in 64 bits, most of them zeros: a frame of 18 sensors takes 18 bytes, not 152.
What does not get smaller, such as the weights of a model, is kept as it is.
"""

from __future__ import annotations

import zlib

MAGIC = b"GLVZIP1\n"
MOST_BYTES = 1 << 32
_BYTES, _WORTH_IT, _LEVEL = 8, 0.8, 6


def packed(content: bytes) -> bytes:
    """What ``unpacked`` gives back."""
    import numpy as np

    whole = len(content) // _BYTES * _BYTES
    numbers = np.frombuffer(content, np.uint8, whole).reshape(-1, _BYTES)
    smaller = MAGIC + zlib.compress(numbers.T.tobytes() + content[whole:], _LEVEL)
    return smaller if len(smaller) < _WORTH_IT * len(content) else content


def unpacked(kept: bytes) -> bytes:
    """The same where it is not packed, and where it cannot be read."""
    import numpy as np

    if not kept.startswith(MAGIC):
        return kept
    unpacking = zlib.decompressobj()
    try:
        content = unpacking.decompress(kept[len(MAGIC) :], MOST_BYTES)
    except zlib.error:
        return kept
    if not unpacking.eof or unpacking.unused_data:
        return kept
    whole = len(content) // _BYTES * _BYTES
    numbers = np.frombuffer(content, np.uint8, whole).reshape(_BYTES, -1)
    return numbers.T.tobytes() + content[whole:]
