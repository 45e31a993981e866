"""A model's effects as rows of a table: one for each rotation, numbers with their units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

MOST_NUMBERS = 8
"""A donning shift has two for each wearing; the rest is counted, and in --json."""
EFFECT_COLUMNS = {
    "effect": "effect",
    "rotation": "rotation",
    "numbers": "learned",
    "evidence": "when it was added",
}


def effect_rows(effects: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """From the ``effect_details`` of a model document."""
    return [
        {
            "effect": effect["effect"] if first else "",
            "rotation": rotation,
            "numbers": _numbers(effect["parameters"].get(rotation, {})),
            "evidence": effect["evidence"] if first else "",
        }
        for effect in effects
        for first, rotation in _marked(effect["rotations"])
    ]


def _marked(rotations: Sequence[str]) -> list[tuple[bool, str]]:
    """Whether it is the first; an effect on no rotation still has a row."""
    return [(place == 0, name) for place, name in enumerate(rotations or [""])]


def _numbers(values: Mapping[str, float | None]) -> str:
    shown = [
        f"{name} {'?' if value is None else format(value, '.3g')}"
        for name, value in list(values.items())[:MOST_NUMBERS]
    ]
    more = len(values) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")
