"""Calibrations of Shadow's CyberGlove driver as YAML: a list of joints, each with its name and its points.

Only what such a file holds is read: names of joints, each followed by pairs of numbers, in whichever of
YAML's two styles. So no YAML parser is needed, and no anchor or tag means anything.
"""

from __future__ import annotations

import re
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
from glovecal_service.vendor_calibrations.shadow_points import OURS, Points, lines_through, points_of

KEY = "cyberglove_calibration"
_TOKEN = re.compile(r"[A-Za-z_][A-Za-z_0-9]*|[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


def read(text: str, counts: Counts, hand: Handedness) -> FoundLines:
    plain = re.sub(r"#.*", "", text)
    if KEY not in plain:
        raise BadInput(f"no {KEY!r}: is it a Shadow calibration?")
    found: dict[str, list[str]] = {}
    name = ""
    for token in _TOKEN.findall(plain.partition(KEY)[2]):
        if token[0].isalpha() or token[0] == "_":
            name = token
            found.setdefault(name, [])
        elif name:
            found[name].append(token)
        else:
            raise BadInput(f"the number {token[:40]} comes before the name of a joint")
    points: dict[str, Points] = {}
    for joint, words in found.items():
        values = numbers(words, f"joint {joint[:40]!r}")
        if len(values) % 2:
            raise BadInput(
                f"joint {joint[:40]!r} has {len(values)} numbers: give pairs, raw value and degrees"
            )
        points[joint] = list(zip(values[::2], values[1::2], strict=True))
    return require_lines(lines_through(points, counts), "the Shadow calibration")


def write(lines: Mapping[str, SensorLine], counts: Counts, hand: Handedness) -> str:
    text = [f"{{'{KEY}': ["]
    for sensor, line in lines.items():
        if sensor not in OURS:
            raise BadInput(f"a Shadow calibration has no joint for sensor {sensor}")
        points = ",".join(f"[{raw:.6f},{degrees:.6f}]" for raw, degrees in points_of(line, counts))
        text.append(f"['{OURS[sensor]}', [{points}]],")
    return "\n".join([*text, "]}", ""])


FORMAT = CalibrationFormat("shadow_yaml", "Shadow CyberGlove driver (YAML)", read, write)
