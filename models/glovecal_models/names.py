"""Which names are allowed: for channels (sensors, rotations, context) and for things in paths and keys."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable

from glovecal_models.errors import BadInput

CHANNEL = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}\Z")
IDENTIFIER = re.compile(r"[a-z0-9][a-z0-9_-]{0,63}\Z")
DEVICES = {"con", "prn", "aux", "nul"} | {f"{port}{n}" for port in ("com", "lpt") for n in range(10)}
"""Identifiers that no file can have on Windows; a data folder may be moved there."""
MOST_LISTED = 24
"""Names in a sentence; an unknown one is mostly a slip of the finger, and the nearest comes first."""


def check_channel_name(name: str, what: str) -> str:
    """Return ``name`` or raise BadInput; channels are letters, digits and underscores."""
    if not CHANNEL.match(name):
        raise BadInput(
            f"{what}: {name!r} is not a channel name (a letter, then letters, digits, _; at most 64)"
        )
    return name


def check_identifier(name: str, what: str) -> str:
    """Return ``name`` or raise BadInput; identifiers go into paths, keys and URLs."""
    if not IDENTIFIER.match(name):
        raise BadInput(
            f"{what}: {name!r} is not allowed; use a-z, 0-9, _ and -, at most 64, not starting with _ or -"
        )
    if name in DEVICES:
        raise BadInput(f"{what}: {name!r} is not allowed: Windows keeps it for a device; add a word to it")
    return name


def subject_name(name: str) -> str:
    """A subject's name as it is stored, which is in lower case: ``Anna`` is ``anna``. Raises BadInput."""
    return check_identifier(name.lower() if name.isascii() else name, "subject")


def did_you_mean(name: str, known: Iterable[str], *, there: str = "there are") -> str:
    """What follows an unknown ``name`` in a sentence: the nearest of ``known``, and which there are."""
    names = list(dict.fromkeys(known))
    if not names:
        return f"{there} none"
    shown = ", ".join(names[:MOST_LISTED])
    more = f" and {len(names) - MOST_LISTED} more" if len(names) > MOST_LISTED else ""
    listed = f"{there} {shown}{more}"
    plain = {each.casefold(): each for each in reversed(names)}
    near = difflib.get_close_matches(name.casefold(), plain, n=1)
    return f"did you mean {plain[near[0]]!r}? {listed[:1].upper()}{listed[1:]}" if near else listed
