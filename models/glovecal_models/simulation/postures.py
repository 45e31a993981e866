"""The named poses of Wang & Neff 2013: four key poses (Figure 4) and five more of Table 3.

Angles are ours: the paper shows the poses as pictures. "Overbend" is read as knuckles and thumb bent as far
as they go with straight fingers. Key poses differ in the wrist too, so that each sensor sees at least two
angles, which is what the paper asks of them.
"""

from __future__ import annotations

from glovecal_models.simulation.simulated_hand import DRIVEN

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
