"""Numbers and models as pages show them: units always there, a dash where there is no number."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def degrees(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}°"


def made_of(model: Mapping[str, Any]) -> str:
    """The method and the effects on top of it."""
    return " + ".join([model["method"], *model["effects"]])
