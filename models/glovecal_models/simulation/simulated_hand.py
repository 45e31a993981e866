"""A simulated person's hand: which rotations follow from which, and its named poses.

A hand is driven in the 17 rotations of ``DRIVEN``. The last finger joints follow the ones before them and the
thumb's virtual joint follows the two at its base, by the rules of Wang & Neff 2013, section 3.3
(``hand/rotations.py`` has them), but every person deviates a little, and not in a straight line. The palm
arch rises as thumb and outer fingers close.

The poses are those of the paper: four key poses (Figure 4) and five more of Table 3. Angles are ours: the
paper shows pictures. "Overbend" is read as knuckles and thumb bent as far as they go with straight fingers.
Key poses differ in the wrist too, so that each sensor sees at least two angles, which is what the paper asks
of them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from glovecal_models.hand.rotations import DIP_SHARE, VIRTUAL_SHARES
from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG
from glovecal_models.simulation.stretch import bent_share

ROTATIONS: tuple[str, ...] = tuple(ACTIVE_RANGE_DEG)
"""All rotations of the simulated hand, in the order of the CyberGlove layouts."""
FINGERS = ("I", "M", "R", "P")
RULED: tuple[str, ...] = ("T_VIR", "I_DIP", "M_DIP", "R_DIP", "P_DIP", "PALM_ARCH")
DRIVEN: tuple[str, ...] = tuple(name for name in ROTATIONS if name not in RULED)

DIP_SLOPE_SD = 0.04
DIP_CURVE_SD_DEG = 2.5
DIP_KNUCKLE_SD_DEG = 1.0
"""How much a bent knuckle pulls the last joint along: no glove without DIP sensors can see it."""
VIRTUAL_SHARE_SD = 0.05
VIRTUAL_CURVE_SD_DEG = 2.0
_PALM_PARTS = {"T_TMC": 6.0, "TI_ABD": -2.0, "R_MCP": 4.0, "P_MCP": 9.0}


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
        for index, finger in enumerate(FINGERS):
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
