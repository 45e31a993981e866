"""One way a physical cause may act: its place in the chain, what it does, and how its size is judged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

import numpy as np

from glovecal_models.simulation.causes.draws import Draws
from glovecal_models.simulation.scene import Scene


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
    judged_by: Literal["own_map", "straight_line", "lost_angle"] = "own_map"
    sizes: tuple[float, float] | None = None
    """Bounds of the size where the disturbance does not simply grow in proportion with it."""
    shared: bool = False
    """One size for the whole glove instead of one per sensor."""
    touches: Touches = "all"
    column: Column | None = None
