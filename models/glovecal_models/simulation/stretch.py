"""Cross-coupling: how bending one joint stretches the sensor of another, in the sizes of a real glove.

Wang & Neff 2013, Table 1, held each rotation still, moved its neighbours as far as they go and wrote down
the standard and the largest deviation of its sensor, in per cent of the rotation's active range. Here one
neighbour's pull is ``size * u ** power`` with u in 0..1 over the neighbour's own range; the two numbers of a
row give size and power, assuming an even sweep. Where the table also says what two neighbours do together,
a product term ``together * u1 * u2`` is fitted to that: it is what a linear map cannot undo.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG

POWERS = (1.0, 4.0)
"""Bounds of the power: beyond 4 a pull would appear all at once at the end of the range."""
_SWEEP = (np.arange(200) + 0.5) / 200

TABLE_1: dict[str, dict[str, tuple[float, float]]] = {
    "TI_ABD": {"T_TMC": (9.6, 25.4)},
    "IM_ABD": {"I_MCP": (22.2, 33.8), "M_MCP": (13.2, 54.1)},
    "MR_ABD": {"M_MCP": (34.4, 92.1), "R_MCP": (42.1, 115.5)},
    "RP_ABD": {"R_MCP": (27.8, 69.2), "P_MCP": (36.0, 80.5)},
    "PALM_ARCH": {
        "T_TMC": (11.5, 37.5),
        "TI_ABD": (27.4, 67.0),
        "I_MCP": (4.3, 15.5),
        "IM_ABD": (5.3, 14.2),
        "M_MCP": (8.6, 36.5),
        "R_MCP": (20.9, 49.7),
        "MR_ABD": (6.7, 24.3),
        "P_MCP": (33.9, 73.0),
        "RP_ABD": (4.2, 16.2),
    },
    "W_FLEX": {"W_ABD": (13.6, 37.5)},
    "W_ABD": {"W_FLEX": (6.5, 26.3)},
}
"""Measuring sensor to affecting joints: (standard, largest) deviation, % of the measured active range."""

TOGETHER: dict[str, tuple[float, float]] = {
    "IM_ABD": (45.7, 114.2),
    "MR_ABD": (42.5, 120.4),
    "RP_ABD": (22.7, 93.8),
}
"""The same for both neighbours moving at once."""

BELOW_THRESHOLD: dict[str, dict[str, float]] = {
    "T_TMC": {"TI_ABD": 4.0, "T_MCP": 2.0},
    "TI_ABD": {"T_MCP": 3.0},
    "T_MCP": {"T_TMC": 4.0, "T_IP": 3.0},
    "T_IP": {"T_MCP": 4.0, "T_TMC": 2.0},
    "I_PIP": {"I_MCP": 0.4},
    "M_PIP": {"M_MCP": 0.4},
    "R_PIP": {"R_MCP": 0.4},
    "P_PIP": {"P_MCP": 0.4},
}
"""Standard deviations in % too small for Table 1 (5 %) but not nothing; the paper found the thumb better
read from its four sensors together. Typical values, with power 2."""


@dataclass(frozen=True)
class Pull:
    """One neighbour's pull on a sensor: ``size * u ** power``, in shares of the measured active range."""

    neighbour: str
    size: float
    power: float


@dataclass(frozen=True)
class Stretch:
    """All pulls on one sensor, and the product term of its first two neighbours."""

    sensor: str
    pulls: tuple[Pull, ...]
    together: float = 0.0

    def share(self, bent: dict[str, np.ndarray]) -> np.ndarray:
        """Deviation in shares of the active range; ``bent`` holds each neighbour's u, at least 0."""
        total = sum(pull.size * bent[pull.neighbour] ** pull.power for pull in self.pulls)
        if self.together:
            total = total + self.together * bent[self.pulls[0].neighbour] * bent[self.pulls[1].neighbour]
        return np.asarray(total)


def bent_share(rotation: str, angles: np.ndarray) -> np.ndarray:
    """Where in its active range a joint is: 0 at the low end (and below), 1 at the high end."""
    low, high = ACTIVE_RANGE_DEG[rotation]
    return np.maximum((angles - low) / (high - low), 0.0)


def deviations(values: np.ndarray) -> tuple[float, float]:
    """Standard and largest deviation from the mean."""
    return float(values.std()), float(np.abs(values - values.mean()).max())


@cache
def stretches() -> tuple[Stretch, ...]:
    """Every sensor's stretch: Table 1 and the smaller couplings."""
    sensors = list(dict.fromkeys([*TABLE_1, *BELOW_THRESHOLD]))
    return tuple(_stretch(sensor) for sensor in sensors)


def _stretch(sensor: str) -> Stretch:
    pulls = [_pull(name, *per_cent) for name, per_cent in TABLE_1.get(sensor, {}).items()]
    quadratic = float((_SWEEP**2).std())
    for name, per_cent in BELOW_THRESHOLD.get(sensor, {}).items():
        pulls.append(Pull(name, per_cent / 100 / quadratic, 2.0))
    alone = Stretch(sensor, tuple(pulls))
    return _with_product_term(alone) if sensor in TOGETHER else alone


def _pull(neighbour: str, standard: float, largest: float) -> Pull:
    """Size and power that come nearest to both deviations (in per cent) over an even sweep."""

    def best_size(power: float) -> tuple[float, float]:
        s, m = deviations(_SWEEP**power)
        s, m = 100 * s / standard, 100 * m / largest
        size = float((s + m) / (s * s + m * m))
        return size, (size * s - 1) ** 2 + (size * m - 1) ** 2

    power = min(np.linspace(*POWERS, 301).tolist(), key=lambda p: best_size(p)[1])
    return Pull(neighbour, best_size(power)[0], power)


def _with_product_term(alone: Stretch) -> Stretch:
    """Add the product term that comes nearest to both deviations when two neighbours move freely at once.

    Two neighbours fully bent together may pull less than either alone, but never the other way.
    """
    standard, largest = TOGETHER[alone.sensor]
    first, second = np.meshgrid(_SWEEP[::4], _SWEEP[::4])
    bent = {alone.pulls[0].neighbour: first, alone.pulls[1].neighbour: second}

    def misfit(together: float) -> float:
        s, m = deviations(Stretch(alone.sensor, alone.pulls, together).share(bent))
        return (100 * s / standard - 1) ** 2 + (100 * m / largest - 1) ** 2

    lowest = -sum(pull.size for pull in alone.pulls)
    together = min(np.linspace(lowest, 3.0, 101).tolist(), key=misfit)
    return Stretch(alone.sensor, alone.pulls, together)
