"""What an effect declares of itself, so that nothing else has to know it by its name."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np

from glovecal_models.effects.base.relations import NO_RELATIONS, Motion, Relations
from glovecal_models.effects.base.signals import Settings, Signals

Kind = Literal["correction", "repair", "interval", "finding", "nothing"]
"""How it acts on a calibration: it adds columns to the prediction, repairs the measured reference, widens the
claimed interval, is only found and shown, or does nothing (the null hypothesis)."""
Control = Literal[
    "time-reversed", "circularly shifted", "context of other takes", "permuted wearings", "none"
]
ShownOver = Literal[
    "angle", "angle both ways", "speed", "hold", "time in take", "wearing", "take", "neighbour", "context",
    "clock shift",
]  # fmt: skip
"""What the one picture of an error that an effect leaves is drawn over: the joint's angle, apart for both
directions of motion where it says so, its speed, the seconds since it came to rest, the take's own time, one
value a wearing or a take, the reading of another sensor, a context column, or trial shifts of the reference
in time."""
HoldDrift = Literal["begins anew with each hold", "slows down", "goes on"]
"""How readings drift while a pose is held."""


@dataclass(frozen=True)
class DriftInHolds:
    """How readings drift while a pose is held, where an effect makes them."""

    how: HoldDrift
    called: str
    """The cause in a sentence."""


@dataclass(frozen=True)
class About:
    """What is known of an effect without any data."""

    explanation: str
    """One sentence for somebody who wears the glove."""
    source: str
    """The paper, standard or measurement it comes from."""
    is_physical: bool = True
    """Whether its name says what happens; not where only a recorded column is named."""
    shown_over: ShownOver = "angle"
    """Over what an error that it leaves is drawn."""
    neighbours: tuple[str, ...] = ()
    """Of an effect shown over a neighbour the sensors that may be it; empty: any."""
    shows_in: tuple[str, ...] = ()
    """What an error that it leaves goes along with, as ``glovecal where`` calls it: "angle", "speed",
    "direction", "time in take", "wearing", and "joint" or "sensor" for any other one. Context columns that it
    reads count by themselves."""
    shown_by: Motion | None = None
    """The recording in which it shows most: proposed against a rival where no recording is known that tells
    the two apart."""
    in_holds: DriftInHolds | None = None
    relations: Relations = NO_RELATIONS
    """Of an effect of one's own: what stands between it and others (``effects/between.py`` has the rest)."""

    def may_show_in(self, column: str, context: Sequence[str]) -> bool:
        """Whether an error that goes along with ``column``, as ``glovecal where`` calls it, may be of it;
        ``context``: the context columns that it reads."""
        kind, _, name = column.partition(" ")
        if kind == "context":
            return name in context
        return column in self.shows_in or (kind in self.shows_in and bool(name))


@dataclass(frozen=True)
class Parameter:
    """A number of the effect that is learned and shown to the user."""

    name: str
    unit: str
    low: float
    high: float
    prior: str
    """What is known before any measurement, in words."""
    tried: tuple[float, ...] = ()
    """Values of the grid."""


@dataclass(frozen=True)
class Shape:
    """What an effect's columns do not depend on linearly, such as a time constant or a width: P numbers."""

    parameters: tuple[Parameter, ...] = ()

    def grid(self, takes: Sequence[Signals], settings: Settings) -> np.ndarray:
        """Shapes to try, (G, L, P), G at least 1: every combination of the values that parameters list."""
        every = list(product(*(item.tried for item in self.parameters)))
        return np.repeat(np.array(every, dtype=float)[:, None], takes[0].own.shape[1], axis=1)


@dataclass(frozen=True)
class Certainty:
    """How small the p value of an effect that changes between takes must be before it is named, and whether
    more is asked of few takes."""

    clear: float
    """Where the effect saves a large share of the error of a model without effects."""
    faint: float
    """Where it saves less, or the model has effects."""
    of_few_takes: float
    """Where there are few takes, whatever it saves. 1: as where there are many, also within takes."""
    why: str
    """What these limits rest on."""


BETWEEN_TAKES = Certainty(
    clear=0.025,
    faint=0.005,
    of_few_takes=0.005,
    why="context columns have many names, and one of them goes along with the takes by chance",
)


Uncertainty = Callable[[np.ndarray], np.ndarray]
"""From the joints' own signal (N, L), degrees, to their correction's variance (N, L), degrees squared."""


class WeightsOfWearings(ABC):
    """What weights of single wearings tell of one that is named: all that is unknown of them, too."""

    are_trained: bool
    """Whether training takes taught any: they are asked again when a model is learned anew."""

    @abstractmethod
    def knows(self, wearing: str) -> bool:
        """Whether something was learned that is special about this wearing."""

    @abstractmethod
    def unknown(self, wearing: str) -> str | None:
        """Why nothing is corrected in this wearing, as a clause; None if something is."""

    @abstractmethod
    def uncertainty(self, weights: np.ndarray, wearing: str) -> Uncertainty | None:
        """What is not known of the correction in a wearing, ``weights`` (L, C); None: nothing."""


@dataclass(frozen=True, eq=False)
class Weights:
    """The C weights of an effect's columns, which are linear and learned in closed form."""

    names: tuple[str, ...]
    """What each multiplies, with its unit, such as "per kelvin (deg/K)"."""
    expected: float | Sequence[float] | np.ndarray = 1.0
    """How large each may be expected to be, as a standard deviation; one number for all."""
    of_wearings: WeightsOfWearings | None = None
    """Where each wearing has weights of its own."""

    @property
    def prior_sd(self) -> np.ndarray:
        """(C,) standard deviations."""
        return np.full(len(self.names), self.expected, dtype=float)
