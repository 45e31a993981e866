"""Calibrations of ASR's CyberGlove library: 22 lines of two points, "radians:reading radians:reading".

The lines begin at the wrist. Flexion is negative radians. The library's fingers have their zero of abduction
where the file says, not where fingers are parallel. Both points of a line at one angle: not fitted.
Uncertain: the direction of the wrist's yaw, taken from the two published files.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from glovecal_models.errors import BadInput
from glovecal_models.hand.handedness import Handedness
from glovecal_service.vendor_calibrations.calibration_format import (
    CalibrationFormat,
    Counts,
    FoundLines,
    SensorLine,
    numbers,
    require_lines,
)

ORDER = (
    "W_ABD", "W_FLEX", "TI_ABD", "T_TMC", "T_MCP", "T_IP",
    "I_MCP", "IM_ABD", "I_PIP", "I_DIP", "M_MCP", "PALM_ARCH", "M_PIP", "M_DIP",
    "R_MCP", "MR_ABD", "R_PIP", "R_DIP", "P_MCP", "RP_ABD", "P_PIP", "P_DIP",
)  # fmt: skip
_POSITIVE = ("W_ABD", "IM_ABD", "TI_ABD")
"""Of these positive radians are taken for positive degrees of ours; all else bends with negative ones. The
readings of abductions fall as fingers spread; in the published files RP_ABD does so with negative radians.
"""


def _sign(sensor: str) -> float:
    return 1.0 if sensor in _POSITIVE else -1.0


def read(text: str, counts: Counts, hand: Handedness) -> FoundLines:
    rows = [line for line in text.splitlines() if line.strip()]
    if len(rows) != len(ORDER):
        raise BadInput(f"{len(rows)} lines; an ASR calibration has {len(ORDER)}, two points each")
    lines, left_out = {}, {}
    for number, (sensor, row) in enumerate(zip(ORDER, rows, strict=True), 1):
        points = [tuple(numbers(word.split(":"), f"line {number}")) for word in row.split()]
        if len(points) != 2 or any(len(point) != 2 for point in points):
            raise BadInput(f"line {number}: {row[:60]!r} is not radians:reading radians:reading")
        first, second = (
            (reading * counts.per_8_bit, _sign(sensor) * math.degrees(angle)) for angle, reading in points
        )
        line = SensorLine.through(first, second)
        if line is None:
            left_out[sensor] = "both points tell one angle or one reading"
        else:
            lines[sensor] = line
    return require_lines(FoundLines(lines, left_out), "the ASR calibration")


def write(lines: Mapping[str, SensorLine], counts: Counts, hand: Handedness) -> str:
    """Both points at the ends of the readings; a sensor without a line has one angle, 0, at both."""
    text = []
    for sensor in ORDER:
        line = lines.get(sensor)
        points = []
        for reading in (1.0, 255.0):
            degrees = 0.0 if line is None else line.gain * (reading * counts.per_8_bit - line.zero)
            points.append(f"{_sign(sensor) * math.radians(degrees):.6f}:{reading:.6f}")
        text.append(" ".join(points))
    unknown = [name for name in lines if name not in ORDER]
    if unknown:
        raise BadInput(f"an ASR calibration has no place for sensor {unknown[0]}")
    return "\n".join([*text, ""])


FORMAT = CalibrationFormat("asr", "ASR CyberGlove library (.cal, two points)", read, write)
