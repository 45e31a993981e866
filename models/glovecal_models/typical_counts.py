"""The reading of each CyberGlove sensor on a typical hand: raw counts at 0 degrees and counts per degree.

Read off two laboratories' public calibration files (three gloves, 8-bit): flexion sensors 0.5 to 1.8 counts
per degree (finger MCP 0.6 to 1.2, PIP 0.9 to 1.7, DIP 0.5 to 1.0, thumb IP 0.6 to 1.3), a straight hand at
32 to 118 counts; sensors between fingers 1 to 3 counts per degree, falling as the fingers spread. One lab's
thumb-index sensor has about 1 count per degree; its direction is not stated, here it rises.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.layout import Layout

TYPICAL_COUNTS: dict[str, tuple[float, float]] = {
    "T_TMC": (70.0, 1.2),
    "TI_ABD": (60.0, 1.2),
    "T_MCP": (80.0, 1.1),
    "T_IP": (70.0, 0.9),
    "I_MCP": (70.0, 0.9),
    "I_PIP": (60.0, 1.3),
    "I_DIP": (65.0, 0.8),
    "IM_ABD": (225.0, -1.8),
    "M_MCP": (72.0, 0.9),
    "M_PIP": (58.0, 1.3),
    "M_DIP": (66.0, 0.8),
    "R_MCP": (70.0, 0.9),
    "R_PIP": (60.0, 1.3),
    "R_DIP": (64.0, 0.8),
    "MR_ABD": (222.0, -1.8),
    "P_MCP": (68.0, 0.9),
    "P_PIP": (62.0, 1.3),
    "P_DIP": (60.0, 0.8),
    "RP_ABD": (218.0, -1.8),
    "PALM_ARCH": (60.0, 1.0),
    "W_FLEX": (125.0, 0.9),
    "W_ABD": (120.0, 1.8),
}
"""Sensor name to (counts at 0 degrees, counts per degree)."""


def raw_angles(layout: Layout, readings: np.ndarray) -> np.ndarray:
    """Uncalibrated angles, shape (N, R) degrees, from ``readings`` (N, S): the column "Raw" of Table 3.

    Readings are rescaled linearly so that the counts a typical glove shows at the two ends of a joint's
    active range become that range (Wang & Neff 2013, section 5.2.2). A rotation without a sensor follows
    its rule from the rescaled sensors. NaN for rotations whose sensors are not a CyberGlove's.
    """
    rescaled = {name: _rescale(name, readings[:, column]) for column, name in enumerate(layout.sensors)}
    angles = np.full((len(readings), len(layout.rotations)), np.nan)
    for column, item in enumerate(layout.correspondences):
        if item.simulated is not None:
            weights = item.simulated.weights(item.sensors)
            angles[:, column] = sum(w * rescaled[s] for w, s in zip(weights, item.sensors, strict=True))
        elif item.rotation in rescaled:
            angles[:, column] = rescaled[item.rotation]
    return angles


def _rescale(sensor: str, counts: np.ndarray) -> np.ndarray:
    if sensor not in TYPICAL_COUNTS:
        return np.full(len(counts), np.nan)
    zero, gain = TYPICAL_COUNTS[sensor]
    return (np.asarray(counts, float) - zero) / gain
