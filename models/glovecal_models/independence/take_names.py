"""What a take's name says: ``still-im_abd`` keeps IM_ABD still, ``still-IM_ABD-move-I_MCP`` moves only I_MCP,
``range IM_ABD`` takes IM_ABD through its range."""

from __future__ import annotations

import re
from collections.abc import Sequence


def rotation_in_name(name: str, rotations: Sequence[str]) -> str | None:
    """The longest of ``rotations`` that stands by itself in the name, before any "move"; or None."""
    found = _found(_words(name).partition("_move_")[0] + "_", rotations)
    return max(found, key=len, default=None)


def moved_in_name(name: str, rotations: Sequence[str]) -> tuple[str, ...]:
    """The rotations that stand after "move" in the name."""
    return tuple(_found("_" + _words(name).partition("_move_")[2], rotations))


def _words(name: str) -> str:
    return f"_{re.sub(r'[^0-9a-z]+', '_', name.lower())}_"


def _found(words: str, rotations: Sequence[str]) -> list[str]:
    """Longer names first, so that MCP is not found in I_MCP."""
    found = []
    for rotation in sorted(rotations, key=len, reverse=True):
        if f"_{rotation.lower()}_" in words:
            found.append(rotation)
            words = words.replace(f"_{rotation.lower()}_", "_/_")
    return found
