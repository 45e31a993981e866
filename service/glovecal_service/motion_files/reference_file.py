"""Reference angles in a file of another system: a motion file, or a table with angles and no readings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.angles_of_points import HandAngles, angles_of_points, named_points
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, HANDS, Handedness
from glovecal_models.takes.answer import ColumnMapping
from glovecal_models.takes.joined_reference import ReferencesByTake
from glovecal_models.takes.table import ReferenceRows, read_reference
from glovecal_service.exports.body_markers import BodyMarkers
from glovecal_service.motion_files.formats import motion_format

FAR_OUTSIDE_DEG = 30.0
"""Of a healthy hand's range: then points are mixed up, or lie far from the joints."""
BACKWARDS_DEG = -15.0
SELDOM = 0.8
"""Share of rows below which it is told that a rotation was seen seldom."""
STILL_DEG = 3.0
LONG_PAUSES = 1.5
"""Of the usual step between rows."""


@dataclass(frozen=True)
class ReferenceFile:
    title: str
    """What kind of file it is."""
    rows: ReferencesByTake
    hand: Handedness | None
    """Whose angles they are; None for a table, which does not say it."""
    hands: tuple[Handedness, ...]
    """That the file holds."""
    made_of: Mapping[str, tuple[str, ...]]
    """What in the file tells each rotation."""
    left_out: Mapping[str, str]
    """Rotations that it does not tell, and why."""
    odd: tuple[str, ...]


def read_reference_file(
    path: Path, mapping: ColumnMapping | None = None, hand: Handedness | None = None
) -> ReferenceFile:
    """``mapping``: how a table is read (default: as a take table). ``hand``: of a motion file (default: the
    one its names say, of two the one that moves more). Raises BadInput."""
    form = motion_format(path)
    if form is None:
        rows = read_reference(path, mapping)
        headers = {} if mapping is None else {item.name: (item.header,) for item in mapping.of("rotation")}
        return ReferenceFile("table", rows, None, (), headers, {}, _odd(rows, {}))
    markers = form.read(path, path.name)
    found, side, hands, names = _of_hand(markers, path.name, hand)
    rows: dict[str | None, ReferenceRows] = {
        None: ReferenceRows(markers.time_s, found.rotations, found.degrees, None)
    }
    made_of = {
        rotation: tuple(names[joint] for joint in joints) for rotation, joints in found.made_of.items()
    }
    return ReferenceFile(form.title, rows, side, hands, made_of, found.left_out, _odd(rows, names))


def _of_hand(
    markers: BodyMarkers, file: str, wanted: Handedness | None
) -> tuple[HandAngles, Handedness, tuple[Handedness, ...], dict[str, str]]:
    """The angles of one hand, which one, those there are, and the name of each joint's point."""
    points = named_points(list(markers.places_mm))
    named = {point.hand for point in points.values()}
    hands: tuple[Handedness, ...] = tuple(hand for hand in HANDS if hand in named)
    if hands and wanted not in (None, *hands):
        raise BadInput(f"{file} holds a {hands[0]} hand and no {wanted} one; choose {hands[0]}")
    sides: tuple[Handedness, ...] = (wanted,) if wanted else hands or HANDS
    read: list[tuple[HandAngles, Handedness, dict[str, str]]] = []
    for side in sides:
        names: dict[str, str] = {}
        for name, point in points.items():
            if point.hand in (None, side):
                names.setdefault(point.joint, name)
        places = {joint: markers.places_mm[name] for joint, name in names.items()}
        read.append((angles_of_points(places, side), side, names))
    found, side, names = max(read, key=lambda each: _moved(each[0]) if hands else _forwards(each[0]))
    if not found.rotations:
        shown = ", ".join(list(markers.places_mm)[:6])
        raise BadInput(
            f"{file} tells no rotation of a hand: its points are called {shown}; names such as "
            "R_index_mcp, R_index_pip and R_index_dip, or RightHandIndex1 to 3, are read"
        )
    return found, side, hands, names


def _moved(angles: HandAngles) -> float:
    return float(np.nanstd(angles.degrees, axis=0).sum()) if angles.rotations else 0.0


def _forwards(angles: HandAngles) -> float:
    """Fingers bend to the palm: of the wrong hand they would bend backwards."""
    return float(np.nansum(angles.degrees))


def _odd(references: ReferencesByTake, names: Mapping[str, str]) -> tuple[str, ...]:
    sentences: list[str] = []
    for take, rows in references.items():
        of = f" of take {take}" if take else ""
        step = np.diff(rows.time_s)
        if len(step) and (pauses := int((step > LONG_PAUSES * np.median(step)).sum())):
            sentences.append(f"{pauses} pauses between rows{of}, of up to {step.max():.2f} s.")
        for name, angles in zip(rows.rotations, rows.reference.T, strict=True):
            low, high = float(np.nanmin(angles)), float(np.nanmax(angles))
            least, most = ACTIVE_RANGE_DEG.get(name, (-180.0, 360.0))
            seen = float(np.isfinite(angles).mean())
            if high - low < STILL_DEG:
                sentences.append(f"{name}{of} hardly moves: {low:.0f} to {high:.0f} degrees.")
            elif low < least - FAR_OUTSIDE_DEG or high > most + FAR_OUTSIDE_DEG:
                sentences.append(
                    f"{name}{of} goes from {low:.0f} to {high:.0f} degrees, a hand's from {least:.0f} to "
                    f"{most:.0f}: is the point the right one?"
                )
            if seen < SELDOM:
                sentences.append(f"{name}{of} was seen in {100 * seen:.0f} % of the rows.")
        bends = [
            float(np.nanmedian(angles))
            for name, angles in zip(rows.rotations, rows.reference.T, strict=True)
            if name.endswith(("MCP", "PIP"))
        ]
        if names and bends and float(np.mean(bends)) < BACKWARDS_DEG:
            sentences.append("The fingers bend backwards: is it the other hand?")
    return tuple(sentences)


def without_readings(mapping: ColumnMapping) -> ColumnMapping:
    """The same for a reference, which has no context and no wearing of its own."""
    kept = ("time", "take", "pose", "rotation", "deviation")
    return replace(
        mapping,
        columns=tuple(
            item if item.role in kept else replace(item, role="ignored", name="", unit="")
            for item in mapping.columns
        ),
    )
