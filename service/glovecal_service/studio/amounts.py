"""Numbers and models as pages show them: units always there, a dash where there is no number."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def degrees(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}°"


def made_of(model: Mapping[str, Any]) -> str:
    """The method and the effects on top of it; an effect that was added twice is named once."""
    return " + ".join(dict.fromkeys([model["method"], *model["effects"]]))


def version_name(model: Mapping[str, Any]) -> str:
    """The same with its held-out error and the first digits of its id."""
    return f"{made_of(model)}, {degrees(model['held_out_rmse_deg'])} ({model['id'][:12]})"
