"""Which computer's monotonic clock times are of: equal for all programs of one computer until it restarts."""

from __future__ import annotations

import hashlib
from functools import cache

from glovecal_client.operating_system import boot


@cache
def computer_id() -> str:
    """16 hexadecimal digits, of which nothing about the computer can be read."""
    return hashlib.sha256(f"glovecal {boot()}".encode()).hexdigest()[:16]
