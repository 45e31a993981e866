"""Calibrations of VirtualHand and its DCU (CyberGlove): offset and gain of six times four sensors.

Two dialects, read alike: the older one has ``FINGER n:`` and comments with "!", the DCU's has a header and a
label a group. A row is joint, offset (8-bit counts), gain (radians a count), and a flag that is not used.
The rule, from a public driver of 1993 and a laboratory's: radians = (reading - offset) x (-gain), flexion
negative. So a positive gain bends with a rising reading.

Abduction is relative to the neighbour, and its gain stands with the finger that moves: that between index and
middle finger has its offset in group 2 and its gain in group 1, row 3, where no sensor is. Readings between
fingers fall as they spread, so a positive gain is one of ours that falls. Uncertain: that sign, and that of
the wrist's yaw, which is turned for a left hand; nobody published a file with its hand beside it.
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

GROUPS = ("Thumb", "Index", "Middle", "Ring", "Pinky", "Palm and wrist")
SLOTS: dict[str, tuple[tuple[int, int], tuple[int, int]]] = {
    "T_TMC": ((0, 0), (0, 0)),
    "T_MCP": ((0, 1), (0, 1)), "T_IP": ((0, 2), (0, 2)), "TI_ABD": ((0, 3), (0, 3)),
    **{
        f"{finger}_{joint}": ((group, row), (group, row))
        for group, finger in enumerate("IMRP", 1)
        for row, joint in enumerate(("MCP", "PIP", "DIP"))
    },
    "IM_ABD": ((2, 3), (1, 3)), "MR_ABD": ((3, 3), (3, 3)), "RP_ABD": ((4, 3), (4, 3)),
    "PALM_ARCH": ((5, 0), (5, 0)), "W_FLEX": ((5, 1), (5, 1)), "W_ABD": ((5, 2), (5, 2)),
}  # fmt: skip
"""Where each sensor's offset and gain stand: group and row."""
_SPREADS = ("IM_ABD", "MR_ABD", "RP_ABD")
LARGEST_OFFSET = 255


def _sign(sensor: str, hand: Handedness) -> float:
    """Of our rotation for a positive gain."""
    if sensor == "W_ABD":
        return -1.0 if hand == "right" else 1.0
    return -1.0 if sensor in _SPREADS else 1.0


def read(text: str, counts: Counts, hand: Handedness) -> FoundLines:
    table = _table(text)
    lines, left_out = {}, {}
    for sensor, (at_offset, at_gain) in SLOTS.items():
        offset, gain = table[at_offset][0], table[at_gain][1]
        degrees = _sign(sensor, hand) * math.degrees(gain) / counts.per_8_bit
        zero = offset * counts.per_8_bit
        if degrees == 0.0 or not math.isfinite(degrees) or not math.isfinite(zero):
            left_out[sensor] = f"gain {gain:g}"
        else:
            lines[sensor] = SensorLine(degrees, zero)
    return require_lines(FoundLines(lines, left_out), "the VirtualHand calibration")


def _table(text: str) -> dict[tuple[int, int], tuple[float, float]]:
    """Offset and gain by group and row."""
    rows: list[tuple[float, float]] = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        expected = len(rows) % 4
        if len(words) >= 3 and words[0] == str(expected) and not line.startswith("!"):
            offset, gain = numbers(words[1:3], f"line {number}")
            rows.append((offset, gain))
        elif expected and words and not line.startswith("!"):
            raise BadInput(
                f"line {number}: row {expected} of group {GROUPS[len(rows) // 4]!r} was expected: joint, "
                f"offset, gain and flag; it is {line[:40]!r}"
            )
        if len(rows) == 4 * len(GROUPS):
            return {(place // 4, place % 4): row for place, row in enumerate(rows)}
    raise BadInput(
        f"{len(rows)} rows of offset and gain were found; {4 * len(GROUPS)} are expected in a "
        "VirtualHand calibration"
    )


def write(lines: Mapping[str, SensorLine], counts: Counts, hand: Handedness) -> str:
    """In the older dialect, which both read. Offsets are whole 8-bit counts: up to half a count is lost."""
    offsets, gains = dict[tuple[int, int], int](), dict[tuple[int, int], float]()
    for sensor, line in lines.items():
        if sensor not in SLOTS:
            raise BadInput(f"a VirtualHand calibration has no place for sensor {sensor}")
        at_offset, at_gain = SLOTS[sensor]
        offset = round(line.zero / counts.per_8_bit)
        if not 0 <= offset <= LARGEST_OFFSET:
            raise BadInput(
                f"{sensor} is 0 degrees at reading {line.zero:.0f}; VirtualHand keeps 0 to {LARGEST_OFFSET} "
                "8-bit counts"
            )
        offsets[at_offset] = offset
        gains[at_gain] = _sign(sensor, hand) * math.radians(line.gain * counts.per_8_bit)
    text = ["VHv1.0", "! written by Glovecal", "GLOVE CALIBRATION follows:", "! joint, offset, gain, gesture"]
    for group in range(len(GROUPS)):
        text.append(f"FINGER {group}:")
        text += [
            f"{row:3d} {offsets.get((group, row), 0):6d} {gains.get((group, row), 0.0):10.5f} {0:5d}"
            for row in range(4)
        ]
    return "\n".join([*text, "! E_O_CAL", "!", ""])


FORMAT = CalibrationFormat("virtualhand", "VirtualHand and DCU (.cal)", read, write)
