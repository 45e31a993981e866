"""Takes that a diagnosis asks for: they separate causes, which no variance of a process can."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def diagnosed_take(diagnosis: Mapping[str, Any]) -> dict[str, Any] | None:
    """What to record by a diagnosis' document, and why in a sentence; None when it asks for nothing."""
    wanted = diagnosis.get("next_take")
    if not wanted:
        return None
    causes = [name.replace("_", " ") for name in wanted["separates"]]
    others, last = causes[:-1], causes[-1]
    rivals = f"{', '.join(others)} {'and' if others else ''} {last}".strip()
    return {
        "what": wanted["what"],
        "seconds": wanted["seconds"],
        "separates": list(wanted["separates"]),
        "reason": f"The diagnosis cannot tell {rivals} apart with the takes there are; this one would.",
    }
