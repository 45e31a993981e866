"""The wall clock in UTC, to the microsecond, as both databases keep it."""

from __future__ import annotations

import secrets
from datetime import UTC, datetime


def now() -> datetime:
    return datetime.now(UTC)


def new_id() -> str:
    """A short random identifier: 48 bits, hexadecimal."""
    return secrets.token_hex(6)
