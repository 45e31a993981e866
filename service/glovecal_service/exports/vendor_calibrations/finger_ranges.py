"""Smallest and largest reading of each joint: OpenGloves (LucidGloves firmware) and LeRobot's Homunculus.

OpenGloves publishes no file for them: its firmware keeps them while it is switched on. Here they are JSON,
finger by finger, such as {"thumb": {"min": 310, "max": 3820}}. The smallest reading is the straight finger,
the largest the bent one; a glove that counts down gives the larger number as "min".

LeRobot has JSON, joint by joint: {"index_mcp_flexion": {"id": 5, "drive_mode": 0, "homing_offset": 0,
"range_min": 1450, "range_max": 3150}, ...}, in counts. It scales a flexion to 0..100 between both, with drive
mode 1 from the largest count on. Which angles these are it does not say: here the ends of a healthy hand's
active range. A finger's abduction stands between -100 and 100 about a middle that no angle is known of: it is
left out.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

from glovecal_models.documents import read_json
from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, FINGERS, Handedness
from glovecal_models.names import did_you_mean
from glovecal_service.exports.vendor_calibrations.calibration_format import (
    CalibrationFormat,
    Counts,
    FoundLines,
    SensorLine,
    numbers,
    require_lines,
)

JOINTS = {letter: f"{letter}_IP" if letter == "T" else f"{letter}_PIP" for letter in FINGERS}
"""Whose active range a finger's line is of; its other joints follow in their own."""


def read_opengloves(text: str, counts: Counts, hand: Handedness) -> FoundLines:
    document = read_json(text, "the calibration")
    if not isinstance(document, dict):
        raise BadInput('expected {"thumb": {"min": 310, "max": 3820}, ...}')
    lines, left_out = {}, {}
    for letter, finger in FINGERS.items():
        if finger not in document:
            continue
        ends = document[finger]
        if not isinstance(ends, dict) or not {"min", "max"} <= set(ends):
            raise BadInput(f'{finger} must have "min" and "max"')
        lowest, highest = numbers([str(ends["min"]), str(ends["max"])], finger)
        low, high = ACTIVE_RANGE_DEG[JOINTS[letter]]
        line = SensorLine.through((lowest, low), (highest, high))
        if line is None:
            left_out[f"{letter}_FLEX"] = "min and max are one reading"
        else:
            lines[f"{letter}_FLEX"] = line
    return require_lines(FoundLines(lines, left_out), "the OpenGloves calibration")


def write_opengloves(lines: Mapping[str, SensorLine], counts: Counts, hand: Handedness) -> str:
    document = {}
    for letter, finger in FINGERS.items():
        line = lines.get(f"{letter}_FLEX")
        if line is not None:
            low, high = ACTIVE_RANGE_DEG[JOINTS[letter]]
            document[finger] = {"min": round(line.reading(low), 3), "max": round(line.reading(high), 3)}
    unknown = [name for name in lines if name not in {f"{letter}_FLEX" for letter in FINGERS}]
    if unknown:
        raise BadInput(f"OpenGloves has one sensor a finger, no {unknown[0]}")
    return json.dumps(document, indent=2) + "\n"


OPENGLOVES = CalibrationFormat(
    "opengloves", "OpenGloves (smallest and largest reading, JSON)", read_opengloves, write_opengloves,
    re.compile(rf'\A\s*\{{\s*"({"|".join(FINGERS.values())})"\s*:\s*\{{\s*"(min|max)"'),
)  # fmt: skip


PARTS = {"cmc": "CMC", "mcp": "MCP", "pip": "PIP", "dip": "DIP", "mcp_flexion": "MCP", "mcp_abduction": "ABD"}
JOINTS_OF: dict[str, tuple[str, ...]] = dict.fromkeys(FINGERS, ("mcp_abduction", "mcp_flexion", "dip"))
JOINTS_OF["T"] = ("cmc", "mcp", "pip", "dip")
LEROBOT_SENSORS = {
    f"{FINGERS[letter]}_{part}": f"{letter}_{PARTS[part]}"
    for letter, parts in JOINTS_OF.items()
    for part in parts
}
"""Sensors of the layout by the names of their joints there, in the order of their numbers."""
ABDUCTION = "abduction is told about a middle whose angle is not known"
RIGHT = '{"index_mcp_flexion": {"drive_mode": 0, "range_min": 1450, "range_max": 3150}, ...}'


def read_lerobot(text: str, counts: Counts, hand: Handedness) -> FoundLines:
    document = read_json(text, "the calibration")
    if not isinstance(document, dict):
        raise BadInput(f"expected {RIGHT}")
    lines, left_out = {}, {}
    for joint, said in document.items():
        if joint not in LEROBOT_SENSORS:
            raise BadInput(f"no joint {joint[:40]!r}; {did_you_mean(joint[:40], LEROBOT_SENSORS)}")
        sensor = LEROBOT_SENSORS[joint]
        line = _line(joint, said)
        if sensor.endswith("ABD"):
            left_out[sensor] = ABDUCTION
        elif line is None:
            left_out[sensor] = "range_min and range_max are one reading"
        else:
            lines[sensor] = line
    return require_lines(FoundLines(lines, left_out), "the LeRobot calibration")


def _line(joint: str, said: Any) -> SensorLine | None:
    """Raises BadInput."""
    if not isinstance(said, dict) or not {"range_min", "range_max"} <= set(said):
        raise BadInput(f'{joint} must have "range_min" and "range_max"')
    lowest, highest, mode, offset = numbers(
        [str(said.get(key, 0)) for key in ("range_min", "range_max", "drive_mode", "homing_offset")], joint
    )
    if mode not in (0, 1):
        raise BadInput(f"{joint}: drive_mode {mode:g} must be 0 or 1")
    if offset:
        raise BadInput(f"{joint}: homing_offset {offset:g} is no reading of this glove; it must be 0")
    if lowest > highest:
        raise BadInput(f"{joint}: range_min {lowest:g} is above range_max {highest:g}; exchange them")
    straight, bent = (highest, lowest) if mode else (lowest, highest)
    low, high = ACTIVE_RANGE_DEG[_rotation(LEROBOT_SENSORS[joint])]
    return SensorLine.through((straight, low), (bent, high))


def _rotation(sensor: str) -> str:
    """Of whose range a line is; the joint called dip bends with the whole finger."""
    return sensor if sensor.endswith("MCP") else JOINTS[sensor[:1]]


def write_lerobot(lines: Mapping[str, SensorLine], counts: Counts, hand: Handedness) -> str:
    document = {}
    for number, (joint, sensor) in enumerate(LEROBOT_SENSORS.items()):
        line = lines.get(sensor)
        if line is not None:
            ends = [line.reading(degrees) for degrees in ACTIVE_RANGE_DEG[_rotation(sensor)]]
            document[joint] = {
                "id": number, "drive_mode": int(ends[0] > ends[1]), "homing_offset": 0,
                "range_min": round(min(ends)), "range_max": round(max(ends)),
            }  # fmt: skip
    unknown = [name for name in lines if name not in LEROBOT_SENSORS.values() or name.endswith("ABD")]
    if unknown:
        raise BadInput(f"a LeRobot calibration has no place for sensor {unknown[0]}")
    return json.dumps(document, indent=4) + "\n"


LEROBOT = CalibrationFormat(
    "lerobot", "LeRobot (Homunculus glove: ranges of joints, JSON)", read_lerobot, write_lerobot,
    re.compile(r'\A\s*\{\s*"\w+"\s*:\s*\{[^{}]*"(range_min|range_max|drive_mode|homing_offset)"'),
)  # fmt: skip
