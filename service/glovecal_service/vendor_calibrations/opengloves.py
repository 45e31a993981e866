"""Smallest and largest reading of each finger, as LucidGloves firmware and OpenGloves scale by.

The project publishes no file for them: its firmware keeps them while it is switched on. Here they are JSON,
finger by finger, such as {"thumb": {"min": 310, "max": 3820}}. The smallest reading is the straight finger,
the largest the bent one; a glove that counts down gives the larger number as "min".
"""

from __future__ import annotations

import json
from collections.abc import Mapping

from glovecal_models.documents import read_json
from glovecal_models.errors import BadInput
from glovecal_models.hand.handedness import Handedness
from glovecal_models.hand.rotations import FINGERS
from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG
from glovecal_service.vendor_calibrations.calibration_format import (
    CalibrationFormat,
    Counts,
    FoundLines,
    SensorLine,
    numbers,
    require_lines,
)

JOINTS = {letter: f"{letter}_IP" if letter == "T" else f"{letter}_PIP" for letter in FINGERS}
"""Whose active range a finger's line is of; its other joints follow in their own."""


def read(text: str, counts: Counts, hand: Handedness) -> FoundLines:
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


def write(lines: Mapping[str, SensorLine], counts: Counts, hand: Handedness) -> str:
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


FORMAT = CalibrationFormat("opengloves", "OpenGloves (smallest and largest reading, JSON)", read, write)
