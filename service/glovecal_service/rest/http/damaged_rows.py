"""Lists that go on without damaged rows; each of those is named in a ``Warning`` header of the answer."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from fastapi import Response

from glovecal_service.plain import plain_text
from glovecal_service.store.errors import DamagedRows

Record = TypeVar("Record")
MOST_NAMED = 20
LONGEST = 400


def without_damaged(response: Response, read: Callable[[], list[Record]]) -> list[Record]:
    """What ``read`` gives, or of damaged rows the sound ones, with the others named in the answer."""
    try:
        return read()
    except DamagedRows as error:
        for sentence in error.damaged[:MOST_NAMED]:
            warn(response, sentence)
        return error.sound


def warn(response: Response, sentence: str) -> None:
    """A header ``Warning: 299 glovecal "..."`` (RFC 7234, section 5.5: a persistent warning)."""
    quoted = plain_text(sentence, LONGEST).encode("ascii", "backslashreplace").decode()
    quoted = quoted.replace("\\", "\\\\").replace('"', '\\"')
    response.headers.append("Warning", f'299 glovecal "{quoted}"')
