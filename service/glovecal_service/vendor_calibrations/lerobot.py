"""Calibrations of LeRobot's Homunculus glove: range and direction of each joint, in counts.

JSON, joint by joint: {"index_mcp_flexion": {"id": 5, "drive_mode": 0, "homing_offset": 0, "range_min": 1450,
"range_max": 3150}, ...}. LeRobot scales a flexion to 0..100 between both, with drive mode 1 from the largest
count on. Which angles these are it does not say: here the ends of a healthy hand's active range. A finger's
abduction stands between -100 and 100 about a middle that no angle is known of: it is left out.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from glovecal_models.documents import read_json
from glovecal_models.errors import BadInput
from glovecal_models.hand.handedness import Handedness
from glovecal_models.hand.rotations import FINGERS
from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG
from glovecal_models.names import did_you_mean
from glovecal_service.vendor_calibrations.calibration_format import (
    CalibrationFormat,
    Counts,
    FoundLines,
    SensorLine,
    numbers,
    require_lines,
)
from glovecal_service.vendor_calibrations.opengloves import JOINTS

PARTS = {"cmc": "CMC", "mcp": "MCP", "pip": "PIP", "dip": "DIP", "mcp_flexion": "MCP", "mcp_abduction": "ABD"}
JOINTS_OF: dict[str, tuple[str, ...]] = dict.fromkeys(FINGERS, ("mcp_abduction", "mcp_flexion", "dip"))
JOINTS_OF["T"] = ("cmc", "mcp", "pip", "dip")
SENSORS = {
    f"{FINGERS[letter]}_{part}": f"{letter}_{PARTS[part]}"
    for letter, parts in JOINTS_OF.items()
    for part in parts
}
"""Sensors of the layout by the names of their joints there, in the order of their numbers."""
ABDUCTION = "abduction is told about a middle whose angle is not known"
RIGHT = '{"index_mcp_flexion": {"drive_mode": 0, "range_min": 1450, "range_max": 3150}, ...}'


def read(text: str, counts: Counts, hand: Handedness) -> FoundLines:
    document = read_json(text, "the calibration")
    if not isinstance(document, dict):
        raise BadInput(f"expected {RIGHT}")
    lines, left_out = {}, {}
    for joint, said in document.items():
        if joint not in SENSORS:
            raise BadInput(f"no joint {joint[:40]!r}; {did_you_mean(joint[:40], SENSORS)}")
        sensor = SENSORS[joint]
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
    low, high = ACTIVE_RANGE_DEG[_rotation(SENSORS[joint])]
    return SensorLine.through((straight, low), (bent, high))


def _rotation(sensor: str) -> str:
    """Of whose range a line is; the joint called dip bends with the whole finger."""
    return sensor if sensor.endswith("MCP") else JOINTS[sensor[:1]]


def write(lines: Mapping[str, SensorLine], counts: Counts, hand: Handedness) -> str:
    document = {}
    for number, (joint, sensor) in enumerate(SENSORS.items()):
        line = lines.get(sensor)
        if line is not None:
            ends = [line.reading(degrees) for degrees in ACTIVE_RANGE_DEG[_rotation(sensor)]]
            document[joint] = {
                "id": number, "drive_mode": int(ends[0] > ends[1]), "homing_offset": 0,
                "range_min": round(min(ends)), "range_max": round(max(ends)),
            }  # fmt: skip
    unknown = [name for name in lines if name not in SENSORS.values() or name.endswith("ABD")]
    if unknown:
        raise BadInput(f"a LeRobot calibration has no place for sensor {unknown[0]}")
    return json.dumps(document, indent=4) + "\n"


FORMAT = CalibrationFormat("lerobot", "LeRobot (Homunculus glove: ranges of joints, JSON)", read, write)
