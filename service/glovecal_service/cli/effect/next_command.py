"""The one command to run after a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

SHORT = 12
LONG_ENOUGH_S = 60
"""Of movement, to tell what is left from noise."""


def next_command(model: str, found: Mapping[str, Any]) -> str:
    """For a diagnosis document of that model."""
    short = model[:SHORT]
    if found.get("reference_problems"):
        return f"glovecal take check {_take_of(found)}"
    named, following = found.get("named"), found.get("next_take")
    if named and named.get("verdict") == "named":
        where = "".join(f" --rotation {name}" for name in named.get("where") or ())
        return f"glovecal add-effect {short} {named['effect']}" + where * _is_on_rotations(found)
    if following:
        return f"glovecal record GLOVE deciding --seconds {following['seconds']}"
    if named:
        return f"glovecal add-effect {short} {named['effect']}"
    left = found.get("something_left") or {}
    if left.get("is_left"):
        return f"glovecal where {short} --report where.html"
    if left.get("not_judgeable"):
        return f"glovecal record GLOVE free-motion --seconds {LONG_ENOUGH_S}"
    return f"glovecal model activate {short}"


def _take_of(found: Mapping[str, Any]) -> str:
    """The take that the first problem speaks of, else the first of all."""
    names = [take["name"] for take in found.get("takes") or ()]
    problem = found["reference_problems"][0]
    spoken_of = [name for name in names if f"take {name}:" in problem]
    name = (spoken_of or names or ["TAKE"])[0]
    return f"'{name}'" if " " in name else name


def _is_on_rotations(found: Mapping[str, Any]) -> bool:
    """Whether the named effect is a correction; a fault is named by its sensors or takes."""
    return found["named"].get("kind") == "correction"
