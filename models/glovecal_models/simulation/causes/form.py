"""A cause to hide in a session: what is asked for, a way it may act, and the record of what was hidden.

A form has its place in the chain, what it does, and how its size is judged. Its random parameters are drawn
by name, so that every use of a name gives the same value.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Literal

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.simulation.scene import Scene


class Draws:
    """Parameters of one cause in one glove; what was drawn is kept in ``values`` as plain numbers."""

    def __init__(self, seed: int, label: str, channels: int) -> None:
        self._key = (seed, 50, zlib.crc32(label.encode()))
        self._channels = channels
        self.values: dict[str, float | list[float]] = {}

    def one(self, name: str, low: float, high: float) -> float:
        """One number for the whole glove, uniform between ``low`` and ``high``."""
        return self._keep(name, float(self.stream(name).uniform(low, high)))

    def each(self, name: str, low: float, high: float) -> np.ndarray:
        """One number per sensor, shape (S,), uniform between ``low`` and ``high``."""
        drawn = self.stream(name).uniform(low, high, self._channels)
        self.values[name] = [round(float(value), 6) for value in drawn]
        return drawn

    def sign(self, name: str = "sign") -> float:
        """-1 or 1 for the whole glove."""
        return self._keep(name, float(self.stream(name).choice([-1.0, 1.0])))

    def signs(self, name: str = "signs") -> np.ndarray:
        """-1 or 1 for each sensor, shape (S,)."""
        drawn = self.stream(name).choice([-1.0, 1.0], self._channels)
        self.values[name] = [float(value) for value in drawn]
        return drawn

    def stream(self, name: str, key: int = 0) -> np.random.Generator:
        """A generator of its own for a name and, say, a take or wearing."""
        return np.random.default_rng([*self._key, zlib.crc32(name.encode()), key])

    def _keep(self, name: str, value: float) -> float:
        self.values[name] = round(value, 6)
        return value


class Stage(IntEnum):
    """Where in the chain a cause acts; lower ones act first."""

    MECHANICAL = 0
    """On what bends the sensor, degrees."""
    ELECTRICAL = 1
    """On the sensor's signal after its curve, degrees."""
    WEARING = 2
    """On how the glove sits, degrees."""
    COUNTS = 3
    """On the amplified signal, before its noise, degrees."""
    CONVERTER = 4
    """On the signal with its noise, before rounding, degrees."""
    TRANSPORT = 5
    """On finished readings on their way."""
    CLOCK = 6
    """On the reference's times."""


Effect = Callable[[np.ndarray, Scene, np.ndarray, Draws], np.ndarray]
"""(signal (T, N, S) in degrees, scene, size (S,), draws) -> the signal with the cause, same shape."""
Column = Callable[[Scene, Draws], tuple[str, np.ndarray]]
"""The context column a cause's measurement adds: its name and values, shape (T, N)."""
Touches = Literal["all", "two", "one", "one_or_all", "palm"]


@dataclass(frozen=True)
class Form:
    """A generator of one cause.

    ``judged_by`` says which part of the disturbance counts as its strength: what no smooth function of the
    own angle explains ("own_map"), no straight line ("straight_line"), or the angle lost because readings
    no longer tell angles apart ("lost_angle").
    """

    name: str
    description: str
    """One sentence, with its source."""
    effect: Effect
    stage: Stage
    set_aside: bool = False
    """Kept for final tests; nobody looks at it while building."""
    only_by_name: bool = False
    """Not among the forms that a session draws by its seed: what a seed makes stays what it was."""
    judged_by: Literal["own_map", "straight_line", "lost_angle"] = "own_map"
    sizes: tuple[float, float] | None = None
    """Bounds of the size where the disturbance does not simply grow in proportion with it."""
    shared: bool = False
    """One size for the whole glove instead of one per sensor."""
    touches: Touches = "all"
    column: Column | None = None


def form(stage: Stage, description: str, **choices: Any) -> Callable[[Effect], Form]:
    """Make a form of the function below, with its name; ``choices`` are further fields of ``Form``."""
    return lambda effect: Form(effect.__name__, description, effect, stage, **choices)


@dataclass(frozen=True)
class Cause:
    """What to hide: its name, one of its forms and how strong."""

    name: str
    """An effect's name, or ``unknown:...`` for a cause outside every catalogue."""
    form: str | None = None
    """The generator's name; None draws one of those that are not set aside from the session's seed."""
    strength_deg: float = 2.0
    """RMS over affected sensors of what a static map of the own angle cannot explain (``session.py``)."""
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
