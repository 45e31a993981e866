"""Calibrations of CyberGlove software: VirtualHand and its DCU, and ASR's library.

VirtualHand has offset and gain of six times four sensors, in two dialects, read alike: the older one has
``FINGER n:`` and comments with "!", the DCU's has a header and a label a group. A row is joint, offset (8-bit
counts), gain (radians a count), and a flag that is not used. The rule, from a public driver of 1993 and a
laboratory's: radians = (reading - offset) x (-gain), flexion negative. So a positive gain bends with a rising
reading.

Abduction is relative to the neighbour, and its gain stands with the finger that moves: that between index and
middle finger has its offset in group 2 and its gain in group 1, row 3, where no sensor is. Readings between
fingers fall as they spread, so a positive gain is one of ours that falls. Uncertain: that sign, and that of
the wrist's yaw, which is turned for a left hand; nobody published a file with its hand beside it.

ASR has 22 lines of two points, "radians:reading radians:reading", which begin at the wrist. Flexion is
negative radians. The library's fingers have their zero of abduction where the file says, not where fingers
are parallel. Both points of a line at one angle: not fitted. Uncertain: the direction of the wrist's yaw,
taken from the two published files.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import Handedness
from glovecal_models.presentation.document import counted
from glovecal_service.exports.vendor_calibrations.calibration_format import (
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


def _virtualhand_sign(sensor: str, hand: Handedness) -> float:
    """Of our rotation for a positive gain."""
    if sensor == "W_ABD":
        return -1.0 if hand == "right" else 1.0
    return -1.0 if sensor in _SPREADS else 1.0


def read_virtualhand(text: str, counts: Counts, hand: Handedness) -> FoundLines:
    table = _table(text)
    lines, left_out = {}, {}
    for sensor, (at_offset, at_gain) in SLOTS.items():
        offset, gain = table[at_offset][0], table[at_gain][1]
        degrees = _virtualhand_sign(sensor, hand) * math.degrees(gain) / counts.per_8_bit
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


def write_virtualhand(lines: Mapping[str, SensorLine], counts: Counts, hand: Handedness) -> str:
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
        gains[at_gain] = _virtualhand_sign(sensor, hand) * math.radians(line.gain * counts.per_8_bit)
    text = ["VHv1.0", "! written by Glovecal", "GLOVE CALIBRATION follows:", "! joint, offset, gain, gesture"]
    for group in range(len(GROUPS)):
        text.append(f"FINGER {group}:")
        text += [
            f"{row:3d} {offsets.get((group, row), 0):6d} {gains.get((group, row), 0.0):10.5f} {0:5d}"
            for row in range(4)
        ]
    return "\n".join([*text, "! E_O_CAL", "!", ""])


VIRTUALHAND = CalibrationFormat(
    "virtualhand", "VirtualHand and DCU (.cal)", read_virtualhand, write_virtualhand,
    re.compile(r"^\s*(FINGER 0|Thumb)\b.*\n(\s*!.*\n)*\s*0(\s+[-+.\deE]+){2}", re.MULTILINE),
)  # fmt: skip


ORDER = (
    "W_ABD", "W_FLEX", "TI_ABD", "T_TMC", "T_MCP", "T_IP",
    "I_MCP", "IM_ABD", "I_PIP", "I_DIP", "M_MCP", "PALM_ARCH", "M_PIP", "M_DIP",
    "R_MCP", "MR_ABD", "R_PIP", "R_DIP", "P_MCP", "RP_ABD", "P_PIP", "P_DIP",
)  # fmt: skip
_POSITIVE = ("W_ABD", "IM_ABD", "TI_ABD")
"""Of these positive radians are taken for positive degrees of ours; all else bends with negative ones. The
readings of abductions fall as fingers spread; in the published files RP_ABD does so with negative radians.
"""


def _asr_sign(sensor: str) -> float:
    return 1.0 if sensor in _POSITIVE else -1.0


def read_asr(text: str, counts: Counts, hand: Handedness) -> FoundLines:
    rows = [line for line in text.splitlines() if line.strip()]
    if len(rows) != len(ORDER):
        raise BadInput(
            f"{counted(len(rows), 'line')}; an ASR calibration has {len(ORDER)} of two points each: choose "
            "another file, or another format"
        )
    lines, left_out = {}, {}
    for number, (sensor, row) in enumerate(zip(ORDER, rows, strict=True), 1):
        points = [tuple(numbers(word.split(":"), f"line {number}")) for word in row.split()]
        if len(points) != 2 or any(len(point) != 2 for point in points):
            raise BadInput(f"line {number}: {row[:60]!r} is not radians:reading radians:reading")
        first, second = (
            (reading * counts.per_8_bit, _asr_sign(sensor) * math.degrees(angle)) for angle, reading in points
        )
        line = SensorLine.through(first, second)
        if line is None:
            left_out[sensor] = "both points tell one angle or one reading"
        else:
            lines[sensor] = line
    return require_lines(FoundLines(lines, left_out), "the ASR calibration")


def write_asr(lines: Mapping[str, SensorLine], counts: Counts, hand: Handedness) -> str:
    """Both points at the ends of the readings; a sensor without a line has one angle, 0, at both."""
    text = []
    for sensor in ORDER:
        line = lines.get(sensor)
        points = []
        for reading in (1.0, 255.0):
            degrees = 0.0 if line is None else line.gain * (reading * counts.per_8_bit - line.zero)
            points.append(f"{_asr_sign(sensor) * math.radians(degrees):.6f}:{reading:.6f}")
        text.append(" ".join(points))
    unknown = [name for name in lines if name not in ORDER]
    if unknown:
        raise BadInput(f"an ASR calibration has no place for sensor {unknown[0]}")
    return "\n".join([*text, ""])


ASR = CalibrationFormat(
    "asr", "ASR CyberGlove library (.cal, two points)", read_asr, write_asr,
    re.compile(r"\A\s*[-+.\deE]+:[-+.\deE]+[ \t]+[-+.\deE]+:[-+.\deE]+[ \t]*\r?$", re.MULTILINE),
)  # fmt: skip
