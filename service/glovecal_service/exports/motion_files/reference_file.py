"""Reference angles in a file of another system: a motion file, or a table with angles and no readings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, HANDS, Handedness
from glovecal_models.presentation.document import first_of
from glovecal_models.takes.answer import ColumnMapping
from glovecal_models.takes.joined_reference import ReferencesByTake
from glovecal_models.takes.table import ReferenceRows, read_reference
from glovecal_service.exports.body_markers import BodyMarkers
from glovecal_service.exports.motion_files.angles_of_points import HandAngles, angles_of_points, named_points
from glovecal_service.exports.motion_files.formats import motion_format

FAR_OUTSIDE_DEG = 30.0
"""Of a healthy hand's range: then points are mixed up, or lie far from the joints."""
BACKWARDS_DEG = -15.0
SELDOM = 0.8
"""Share of rows below which it is sentences that a rotation was seen seldom."""
STILL_DEG = 3.0
UNMOVED_DEG = 0.1
"""A bone that moves less was not measured, but rests in the skeleton."""
MOST_NAMED = 6
FARTHEST_MM = 1e6
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
    angles, side, hands, names = _of_hand(markers, path.name, hand)
    moves = np.nanmax(angles.degrees, axis=0) - np.nanmin(angles.degrees, axis=0) > UNMOVED_DEG
    unmoved = [name for name, does in zip(angles.rotations, moves, strict=True) if not does]
    if len(unmoved) == len(angles.rotations):
        raise BadInput(f"no finger of the {side} hand moves in {path.name}; choose the other hand, or file")
    moving = tuple(name for name in angles.rotations if name not in unmoved)
    rows: dict[str | None, ReferenceRows] = {
        None: ReferenceRows(markers.time_s, moving, angles.degrees[:, moves], None)
    }
    made_of = {name: tuple(names[joint] for joint in angles.made_of[name]) for name in moving}
    left_out = {**angles.left_out, **dict.fromkeys(unmoved, "it never moves in the file")}
    return ReferenceFile(form.title, rows, side, hands, made_of, left_out, _odd(rows, names))


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
        places = {joint: _sane(markers.places_mm[name]) for joint, name in names.items()}
        read.append((angles_of_points(places, side), side, names))
    angles, side, names = max(read, key=lambda each: _moved(each[0]) if hands else _forwards(each[0]))
    if not angles.rotations:
        shown = ", ".join(list(markers.places_mm)[:6])
        raise BadInput(
            f"{file} tells no rotation of a hand: its points are called {shown}; names such as "
            "R_index_mcp, R_index_pip and R_index_dip, or RightHandIndex1 to 3, are read"
        )
    return angles, side, hands, names


def _sane(places_mm: np.ndarray) -> np.ndarray:
    """A point that is farther than any room is long was not seen."""
    with np.errstate(invalid="ignore"):
        return np.where((np.abs(places_mm) < FARTHEST_MM).all(axis=1, keepdims=True), places_mm, np.nan)


def _moved(angles: HandAngles) -> float:
    return float(np.nanstd(angles.degrees, axis=0).sum()) if angles.rotations else 0.0


def _forwards(angles: HandAngles) -> float:
    """Fingers bend to the palm: of the wrong hand they would bend backwards."""
    return float(np.nansum(angles.degrees))


def _odd(references: ReferencesByTake, names: Mapping[str, str]) -> tuple[str, ...]:
    """One sentence of a kind, with all rotations it is true of."""
    pauses: list[float] = []
    still, outside, seldom, bends = list[str](), list[str](), list[str](), list[float]()
    for rows in references.values():
        step = np.diff(rows.time_s)
        pauses += step[step > LONG_PAUSES * np.median(step)].tolist() if len(step) else []
        for name, angles in zip(rows.rotations, rows.reference.T, strict=True):
            low, high = float(np.nanmin(angles)), float(np.nanmax(angles))
            least, most = ACTIVE_RANGE_DEG.get(name, (-180.0, 360.0))
            seen = float(np.isfinite(angles).mean())
            if high - low < STILL_DEG:
                still.append(f"{name} ({low:.0f} to {high:.0f} degrees)")
            elif low < least - FAR_OUTSIDE_DEG or high > most + FAR_OUTSIDE_DEG:
                outside.append(
                    f"{name} ({low:.0f} to {high:.0f}, a hand's {least:.0f} to {most:.0f} degrees)"
                )
            if seen < SELDOM:
                seldom.append(f"{name} ({100 * seen:.0f} %)")
            if name.endswith(("MCP", "PIP")):
                bends.append(float(np.nanmedian(angles)))
    sentences = {
        f"{len(pauses)} pauses between rows, of up to {max(pauses, default=0.0):.2f} s.": bool(pauses),
        f"Hardly move: {first_of(still, MOST_NAMED)}.": bool(still),
        f"Beyond a hand's range: {first_of(outside, MOST_NAMED)}. Are the points mixed up?": bool(outside),
        f"Seen in few rows: {first_of(seldom, MOST_NAMED)}.": bool(seldom),
        "The fingers bend backwards: is it the other hand?": (
            bool(names) and bool(bends) and float(np.mean(bends)) < BACKWARDS_DEG
        ),
    }
    return tuple(sentence for sentence, is_so in sentences.items() if is_so)


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
