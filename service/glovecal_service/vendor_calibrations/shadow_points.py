"""What both calibration files of Shadow's CyberGlove driver hold: points of each joint, raw 0 to 1, degrees.

Raw is (reading - lowest) / (highest - lowest). The driver goes through all points, piece by piece; here a
line goes through them by least squares, and a sensor that is more than ``MOST_OFF_DEG`` from it is left out
rather than bent; what a line misses by less is told. Points whose raw values hardly differ are a sensor that
was switched off.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from glovecal_service.vendor_calibrations.calibration_format import Counts, FoundLines, SensorLine

NAMES = {
    "G_ThumbRotate": "T_TMC", "G_ThumbMPJ": "T_MCP", "G_ThumbIJ": "T_IP", "G_ThumbAb": "TI_ABD",
    "G_IndexMPJ": "I_MCP", "G_IndexPIJ": "I_PIP", "G_IndexDIJ": "I_DIP",
    "G_MiddleMPJ": "M_MCP", "G_MiddlePIJ": "M_PIP", "G_MiddleDIJ": "M_DIP", "G_MiddleIndexAb": "IM_ABD",
    "G_RingMPJ": "R_MCP", "G_RingPIJ": "R_PIP", "G_RingDIJ": "R_DIP", "G_RingMiddleAb": "MR_ABD",
    "G_PinkieMPJ": "P_MCP", "G_PinkiePIJ": "P_PIP", "G_PinkieDIJ": "P_DIP", "G_PinkieRingAb": "RP_ABD",
    "G_PalmArch": "PALM_ARCH", "G_WristPitch": "W_FLEX", "G_WristYaw": "W_ABD",
}  # fmt: skip
OURS = {sensor: name for name, sensor in NAMES.items()}
LEAST_SPAN = 0.01
"""Of raw values between which a line goes."""
MOST_OFF_DEG = 5.0
TOLD_OFF_DEG = 1.0
"""A line farther from its points is told of: the driver would go through them."""
Points = Sequence[tuple[float, float]]
"""Raw value and degrees."""


def lines_through(points: Mapping[str, Points], counts: Counts) -> FoundLines:
    """``points`` by Shadow's name of the joint."""
    lines, left_out, doubts = {}, {}, {}
    for name, own in points.items():
        if name not in NAMES:
            left_out[name] = "no such joint is known"
            continue
        sensor, table = NAMES[name], np.array(own, dtype=float).reshape(-1, 2)
        if len(table) < 2 or np.ptp(table[:, 0]) < LEAST_SPAN or np.ptp(table[:, 1]) == 0:
            left_out[sensor] = f"{len(table)} points tell no line"
            continue
        gain, start = np.polyfit(table[:, 0], table[:, 1], 1)
        off = float(np.abs(gain * table[:, 0] + start - table[:, 1]).max())
        if off > MOST_OFF_DEG or not np.isfinite(off) or gain == 0:
            left_out[sensor] = f"its {len(table)} points are up to {off:.0f} degrees from a line"
            continue
        span = counts.highest - counts.lowest
        line = SensorLine(float(gain) / span, counts.lowest - span * float(start / gain))
        if np.isfinite(line.zero):
            lines[sensor] = line
            if off > TOLD_OFF_DEG:
                doubts[sensor] = f"the line misses its {len(table)} points by up to {off:.1f} degrees"
        else:
            left_out[sensor] = "its points tell no line"
    return FoundLines(lines, left_out, doubts)


def points_of(line: SensorLine, counts: Counts) -> Points:
    """At both ends of the readings."""
    ends = (counts.lowest, counts.highest)
    return [(raw, line.gain * (reading - line.zero)) for raw, reading in zip((0.0, 1.0), ends, strict=True)]
