"""Free text that people give (titles, take names, wearings): bounded, one line, storable everywhere."""

from __future__ import annotations

import unicodedata

from glovecal_models.errors import BadInput

LONGEST = 200


def check_text(text: str, what: str, *, empty: bool = False) -> str:
    """Return ``text`` or raise BadInput: at most 200 characters, no control characters or lone surrogates."""
    if not isinstance(text, str):
        raise BadInput(f"{what} must be text, not {type(text).__name__}")
    if not text and not empty:
        raise BadInput(f"{what} is empty; give it a name")
    if len(text) > LONGEST:
        raise BadInput(f"{what} has {len(text)} characters; at most {LONGEST} are kept")
    for character in text:
        if unicodedata.category(character) in ("Cc", "Cs", "Zl", "Zp"):
            raise BadInput(f"{what} holds the character U+{ord(character):04X}, which is not text")
    return text
