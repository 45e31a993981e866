"""A cause to be hidden in a session, and the record of what was hidden."""

from __future__ import annotations

from dataclasses import dataclass, field

from glovecal_models.errors import BadInput


@dataclass(frozen=True)
class Cause:
    """What to hide: its name, one of its forms and how strong."""

    name: str
    """An effect's name, or ``unknown:...`` for a cause outside every catalogue."""
    form: str | None = None
    """The generator's name; None draws one of those that are not set aside from the session's seed."""
    strength_deg: float = 2.0
    """RMS over affected sensors of what a static map of the own angle cannot explain (strength.py)."""
    channels: tuple[str, ...] | None = None
    """Sensors concerned; None for all that make sense, drawn where a cause usually sits in one or two.
    Causes of the whole glove (clock, transport, supply) always concern all."""

    def __post_init__(self) -> None:
        if not self.strength_deg > 0:
            raise BadInput(f"strength_deg is {self.strength_deg}; a cause needs a size above 0")


@dataclass(frozen=True)
class HiddenCause:
    """What was hidden, as plain data."""

    name: str
    form: str
    description: str
    stage: str
    channels: tuple[str, ...]
    strength_deg: float
    """What was asked for."""
    reached_deg: dict[str, float]
    """What each affected sensor got; less than asked where the form cannot do more on this motion."""
    sizes: dict[str, float]
    """The form's own size parameter for each affected sensor."""
    parameters: dict[str, float | list[float]] = field(default_factory=dict)
    """Everything drawn; lists have one entry per sensor of the glove."""
    column: str | None = None
    """The context column that records the cause, where there is one."""
