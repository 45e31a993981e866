"""Calibrations of Shadow's CyberGlove driver as XML: joints with points of raw value and degrees.

A document type is refused before anything is parsed: with it entities could be declared, and these files have
no use for one.
"""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree

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

ROOT = "Cyberglove_calibration"


def read(text: str, counts: Counts, hand: Handedness) -> FoundLines:
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


def write(lines: Mapping[str, SensorLine], counts: Counts, hand: Handedness) -> str:
    root = ElementTree.Element(ROOT)
    for sensor, line in lines.items():
        if sensor not in OURS:
            raise BadInput(f"a Shadow calibration has no joint for sensor {sensor}")
        joint = ElementTree.SubElement(root, "Joint", name=OURS[sensor])
        for raw, degrees in points_of(line, counts):
            ElementTree.SubElement(joint, "calib", raw_value=f"{raw:.6f}", calibrated_value=f"{degrees:.6f}")
    ElementTree.indent(root)
    return '<?xml version="1.0" ?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


FORMAT = CalibrationFormat("shadow_xml", "Shadow CyberGlove driver (XML)", read, write)
