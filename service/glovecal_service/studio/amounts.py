"""Numbers and models as pages show them: units always there, a dash where there is no number."""

from __future__ import annotations

from datetime import datetime

from glovecal_service.rest.model.answer import Model


def degrees(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}°"


def moment(at: datetime | None) -> str:
    """By the clock of the service's computer."""
    return "–" if at is None else f"{at.astimezone():%Y-%m-%d %H:%M}"


def seconds(value: float) -> str:
    """As long as a person would say it."""
    return f"{value:.1f} s" if value < 60 else f"{value / 60:.0f} min {value % 60:.0f} s"


def made_of(model: Model) -> str:
    """The method and the effects on top of it; an effect that was added twice is named once."""
    return " + ".join(dict.fromkeys([model.method, *model.effects]))


def version_name(model: Model) -> str:
    """The same with its name, its held-out error and the first digits of its id."""
    name = f"{model.name}, " if model.name else ""
    return f"{name}{made_of(model)}, {degrees(model.held_out_rmse_deg)} ({model.short})"
