"""A simulated person's hand: which rotations follow from which, and its named poses.

A hand is driven in the 17 rotations of ``DRIVEN``. The last finger joints follow the ones before them and the
thumb's virtual joint follows the two at its base, by the rules of Wang & Neff 2013, section 3.3
(``hand/rotations.py`` has them), but every person deviates a little, and not in a straight line. The palm
arch rises as thumb and outer fingers close.

The poses are those of the paper: four key poses (Figure 4) and five more of Table 3. Angles are ours: the
paper shows pictures. "Overbend" is read as knuckles and thumb bent as far as they go with straight fingers.
Key poses differ in the wrist too, so that each sensor sees at least two angles, which is what the paper asks
of them.

Cross-coupling: how bending one joint stretches the sensor of another, in the sizes of a real glove.

Wang & Neff 2013, Table 1, held each rotation still, moved its neighbours as far as they go and wrote down
the standard and the largest deviation of its sensor, in per cent of the rotation's active range. Here one
neighbour's pull is ``size * u ** power`` with u in 0..1 over the neighbour's own range; the two numbers of a
row give size and power, assuming an even sweep. Where the table also says what two neighbours do together,
a product term ``together * u1 * u2`` is fitted to that: it is what a linear map cannot undo.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, DIP_SHARE, VIRTUAL_SHARES

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
ROTATIONS: tuple[str, ...] = tuple(ACTIVE_RANGE_DEG)
"""All rotations of the simulated hand, in the order of the CyberGlove layouts."""
LONG_FINGERS = ("I", "M", "R", "P")
RULED: tuple[str, ...] = ("T_VIR", "I_DIP", "M_DIP", "R_DIP", "P_DIP", "PALM_ARCH")
DRIVEN: tuple[str, ...] = tuple(name for name in ROTATIONS if name not in RULED)

DIP_SLOPE_SD = 0.04
DIP_CURVE_SD_DEG = 2.5
DIP_KNUCKLE_SD_DEG = 1.0
"""How much a bent knuckle pulls the last joint along: no glove without DIP sensors can see it."""
VIRTUAL_SHARE_SD = 0.05
VIRTUAL_CURVE_SD_DEG = 2.0
_PALM_PARTS = {"T_TMC": 6.0, "TI_ABD": -2.0, "R_MCP": 4.0, "P_MCP": 9.0}


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


class SimulatedHand:
    """The rules of one person, fixed by ``seed``."""

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng([seed, 1])
        self._dip_slope = DIP_SHARE + DIP_SLOPE_SD * random.standard_normal(4)
        self._dip_curve = DIP_CURVE_SD_DEG * random.standard_normal(4)
        self._dip_knuckle = DIP_KNUCKLE_SD_DEG * random.standard_normal(4)
        shares = [VIRTUAL_SHARES[name] for name in ("T_TMC", "TI_ABD")]
        self._virtual_share = shares + VIRTUAL_SHARE_SD * random.standard_normal(2)
        self._virtual_curve = VIRTUAL_CURVE_SD_DEG * random.standard_normal()

    def complete(self, driven: Mapping[str, np.ndarray]) -> np.ndarray:
        """All rotations, shape (N, len(ROTATIONS)) degrees, from the driven ones, each shape (N,)."""
        angles = {name: np.asarray(driven[name], float) for name in DRIVEN}
        for index, finger in enumerate(LONG_FINGERS):
            angles[f"{finger}_DIP"] = self._last_joint(
                index, angles[f"{finger}_PIP"], angles[f"{finger}_MCP"]
            )
        turn, spread = angles["T_TMC"], angles["TI_ABD"]
        share = self._virtual_share
        curve = self._virtual_curve * np.sin(np.pi * bent_share("T_TMC", turn))
        angles["T_VIR"] = share[0] * turn + share[1] * spread + curve
        closing = sum(size * bent_share(name, angles[name]) for name, size in _PALM_PARTS.items())
        angles["PALM_ARCH"] = np.maximum(4.0 + closing, 0.0)
        return np.column_stack([angles[name] for name in ROTATIONS])

    def _last_joint(self, finger: int, middle: np.ndarray, knuckle: np.ndarray) -> np.ndarray:
        curve = self._dip_curve[finger] * np.sin(np.pi * bent_share("I_PIP", middle))
        pulled = self._dip_knuckle[finger] * (bent_share("I_MCP", knuckle) - 0.5)
        return self._dip_slope[finger] * middle + curve + pulled


KEY_POSES = ("flat", "spread", "fist", "overbend")
TABLE_3_POSES = (*KEY_POSES, "thumb_up", "pointing", "pinky_up", "rest", "ok")

# In the order of DRIVEN.
_ANGLES: dict[str, tuple[float, ...]] = {
    #            T_TMC ABD MCP  IP   I_MCP PIP ABD  M_MCP PIP  R_MCP PIP ABD  P_MCP PIP ABD  W_FL ABD
    "flat":     (5, 10, 2, 2,        0, 2, 2,       0, 2,      0, 2, 2,       0, 2, 2,       0, 0),
    "spread":   (5, 60, 5, 5,        -2, 3, 26,     -2, 3,     -2, 3, 22,     -2, 3, 26,     -25, 10),
    "fist":     (50, 25, 40, 55,     85, 95, 1,     88, 97,    86, 96, 1,     84, 92, 1,     -30, 5),
    "overbend": (55, 20, 48, 70,     88, 12, 3,     89, 12,    88, 12, 3,     86, 14, 3,     45, -20),
    "thumb_up": (10, 55, 5, 2,       80, 92, 2,     84, 95,    82, 94, 2,     78, 88, 3,     -5, 14),
    "pointing": (48, 28, 35, 45,     5, 8, 6,       75, 85,    78, 90, 2,     74, 84, 4,     -10, 0),
    "pinky_up": (45, 25, 35, 50,     78, 88, 2,     80, 92,    62, 80, 4,     5, 10, 14,     -15, -8),
    "rest":     (18, 32, 14, 20,     28, 35, 6,     32, 38,    34, 40, 4,     36, 40, 6,     -12, -4),
    "ok":       (42, 38, 24, 32,     52, 58, 10,    18, 20,    12, 16, 9,     6, 12, 12,     -18, 4),
}  # fmt: skip

POSTURES: dict[str, dict[str, float]] = {
    name: dict(zip(DRIVEN, map(float, angles), strict=True)) for name, angles in _ANGLES.items()
}
"""Pose name to the angle of each driven rotation, degrees."""
