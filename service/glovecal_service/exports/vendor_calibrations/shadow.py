"""Calibrations of Shadow's CyberGlove driver, XML and YAML: points of each joint, raw 0 to 1, degrees.

Raw is (reading - lowest) / (highest - lowest). The driver goes through all points, piece by piece; here a
line goes through them by least squares, and a sensor that is more than ``MOST_OFF_DEG`` from it is left out
rather than bent; what a line misses by less is told. Points whose raw values hardly differ are a sensor that
was switched off.

Of YAML only what such a file holds is read: a list of joints, names each followed by pairs of numbers, in
whichever of YAML's two styles. So no YAML parser is needed, and no anchor or tag means anything.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from xml.etree import ElementTree

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import Handedness
from glovecal_service.exports.vendor_calibrations.calibration_format import (
    CalibrationFormat,
    Counts,
    FoundLines,
    SensorLine,
    numbers,
    require_lines,
)

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


ROOT = "Cyberglove_calibration"


def read_xml(text: str, counts: Counts, hand: Handedness) -> FoundLines:
    if "<!" in text.replace("<!--", ""):
        raise BadInput("the file declares a document type or entities; a Shadow calibration needs none")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError):
        raise BadInput("the file is not valid XML; is it a Shadow calibration, whole?") from None
    if root.tag != ROOT:
        raise BadInput(f"the root is {root.tag[:40]!r}, expected {ROOT!r}")
    points: dict[str, Points] = {}
    for joint in root.findall("Joint"):
        name = joint.get("name", "")
        words = [
            (each.get("raw_value", ""), each.get("calibrated_value", "")) for each in joint.findall("calib")
        ]
        pairs = [numbers(pair, f"joint {name[:40]!r}") for pair in words]
        points[name] = [(raw, degrees) for raw, degrees in pairs]
    return require_lines(lines_through(points, counts), "the Shadow calibration")


def write_xml(lines: Mapping[str, SensorLine], counts: Counts, hand: Handedness) -> str:
    root = ElementTree.Element(ROOT)
    for sensor, line in lines.items():
        if sensor not in OURS:
            raise BadInput(f"a Shadow calibration has no joint for sensor {sensor}")
        joint = ElementTree.SubElement(root, "Joint", name=OURS[sensor])
        for raw, degrees in points_of(line, counts):
            ElementTree.SubElement(joint, "calib", raw_value=f"{raw:.6f}", calibrated_value=f"{degrees:.6f}")
    ElementTree.indent(root)
    return '<?xml version="1.0" ?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


SHADOW_XML = CalibrationFormat(
    "shadow_xml", "Shadow CyberGlove driver (XML)", read_xml, write_xml, re.compile(rf"<{ROOT}\b")
)


KEY = "cyberglove_calibration"
_TOKEN = re.compile(r"[A-Za-z_][A-Za-z_0-9]*|[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


def read_yaml(text: str, counts: Counts, hand: Handedness) -> FoundLines:
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


def write_yaml(lines: Mapping[str, SensorLine], counts: Counts, hand: Handedness) -> str:
    text = [f"{{'{KEY}': ["]
    for sensor, line in lines.items():
        if sensor not in OURS:
            raise BadInput(f"a Shadow calibration has no joint for sensor {sensor}")
        points = ",".join(f"[{raw:.6f},{degrees:.6f}]" for raw, degrees in points_of(line, counts))
        text.append(f"['{OURS[sensor]}', [{points}]],")
    return "\n".join([*text, "]}", ""])


SHADOW_YAML = CalibrationFormat(
    "shadow_yaml", "Shadow CyberGlove driver (YAML)", read_yaml, write_yaml,
    re.compile(rf"^\s*\{{?\s*['\"]?{KEY}['\"]?\s*:", re.MULTILINE),
)  # fmt: skip
