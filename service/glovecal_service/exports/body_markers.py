"""Markers of an optical system: read, put onto the hands' time, and hands placed by them.

Krnoul et al. 2016 (section 2): the glove's readings end at the forearm. Either its wrist sensors turn the
hand, and markers tell the wrist's place and the forearm; or markers on the back of the hand tell the whole
wrist, and its wrist sensors are ignored. Markers are taken to lie on the bones: what skin adds is not known.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TextIO

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_models.takes.take import LONGEST_INTERPOLATED_GAP_S, Take

Wrist = Literal["glove", "optical"]
NEEDED: dict[Wrist, tuple[str, ...]] = {
    "glove": ("wrist at the thumb's side", "wrist at the little finger's side", "elbow"),
    "optical": (
        "wrist at the thumb's side", "wrist at the little finger's side",
        "back of the hand at the thumb's side", "back of the hand at the little finger's side",
    ),
}  # fmt: skip
"""Which markers place a hand, in order."""
_UNITS = {"mm": 1.0, "m": 1000.0, "cm": 10.0}
_HEAD_LINES = 5
MOST_MARKERS = 1000
MOST_CELLS = 20_000_000
"""Of a file, 160 MB: 50 markers for half an hour at 70 Hz."""
LONGEST_LINE = 100_000
"""Characters: 1000 markers, each number with 30 digits."""
SHORTEST_MM = 1.0


@dataclass(frozen=True)
class BodyMarkers:
    """N frames of markers."""

    time_s: np.ndarray
    """(N,), increasing, by the optical system's clock."""
    places_mm: Mapping[str, np.ndarray]
    """(N, 3) by name; NaN where a marker was not seen."""

    def at(self, time_s: np.ndarray) -> dict[str, np.ndarray]:
        """At other times of the same clock, between frames that are 0.1 s apart at most. Raises BadInput for
        more than ``MOST_CELLS`` numbers."""
        count = 3 * len(self.places_mm) * len(time_s)
        if count > MOST_CELLS:
            raise BadInput(
                f"{len(self.places_mm)} markers in {len(time_s)} frames are {count} numbers, {MOST_CELLS} at "
                "most; leave markers out, or export a shorter take"
            )
        return {name: _between(time_s, self.time_s, places) for name, places in self.places_mm.items()}

    def as_take(self) -> Take:
        """Markers as readings, for a clap; a frame without all of them is left out."""
        places = np.concatenate(list(self.places_mm.values()), axis=1)
        seen = np.isfinite(places).all(axis=1)
        names = tuple(f"{name}-{axis}" for name in self.places_mm for axis in "xyz")
        return Take("body", "", names, self.time_s[seen], places[seen])


@dataclass(frozen=True)
class HandFrame:
    """Where a hand's frame is, N times."""

    origin_mm: np.ndarray
    """(N, 3)."""
    axes: np.ndarray
    """(N, 3, 3): columns x to the fingers, y to the right hand's thumb, z out of the back of the hand."""

    def frames(self, which: slice) -> HandFrame:
        """Some of the frames."""
        return HandFrame(self.origin_mm[which], self.axes[which])

    def placed(self, places_mm: np.ndarray) -> np.ndarray:
        """(N, 3) of the hand's frame as places of the optical system's."""
        return self.origin_mm + np.einsum("nij,nj->ni", self.axes, places_mm)


def hand_frame(
    markers: Mapping[str, np.ndarray], names: Sequence[str], wrist: Wrist, *, is_left: bool
) -> HandFrame:
    """From the markers ``names`` (as ``NEEDED``). Raises BadInput for a wrong number, or an unknown one."""
    if len(names) != len(NEEDED[wrist]):
        raise BadInput(
            f"wrist from {wrist} needs the markers {', '.join(NEEDED[wrist])}; got {', '.join(names)}"
        )
    for name in names:
        if name not in markers:
            raise BadInput(f"no marker {name!r}; {did_you_mean(name, markers)}")
    places = [markers[name] for name in names]
    origin = (places[0] + places[1]) / 2
    if wrist == "glove":
        along, across = origin - places[2], places[0] - places[1]
    else:
        along, across = (places[2] + places[3]) / 2 - origin, places[2] - places[3]
    x = _unit(along)
    z = _unit(np.cross(x, -across if is_left else across))
    return HandFrame(origin, np.stack([x, np.cross(z, x), z], axis=2))


def read_trc(path: Path, name: str) -> BodyMarkers:
    """A TRC file in mm, cm or m. Raises BadInput that names ``name``, the line and what would be right."""
    with path.open(encoding="utf-8-sig", errors="replace") as stream:
        head = [stream.readline(LONGEST_LINE).rstrip("\n") for _ in range(_HEAD_LINES)]
        if not head[0].startswith("PathFileType"):
            raise BadInput(f"{name} is no TRC file: its first line must begin with PathFileType")
        facts = dict(zip(head[1].split("\t"), head[2].split("\t"), strict=False))
        unit = facts.get("Units", "").strip()
        if unit not in _UNITS:
            raise BadInput(f"{name}, line 3: unit {unit[:40]!r} must be one of {', '.join(_UNITS)}")
        names = [each.strip() for each in head[3].rstrip().split("\t")[2:] if each.strip()]
        if not names or len(set(names)) != len(names):
            raise BadInput(f"{name}, line 4: markers must have names, each another")
        if len(names) > MOST_MARKERS:
            raise BadInput(f"{name}, line 4: {len(names)} markers are too many; give at most {MOST_MARKERS}")
        table = _rows(stream, name, 1 + 3 * len(names))
    if len(table) < 2 or not (np.diff(table[:, 0]) > 0).all():
        raise BadInput(f"{name} needs two frames or more, whose times increase")
    places = table[:, 1:].reshape(len(table), -1, 3) * _UNITS[unit]
    return BodyMarkers(table[:, 0], {each: places[:, at] for at, each in enumerate(names)})


def _rows(stream: TextIO, name: str, width: int) -> np.ndarray:
    """(N, width): time and places, NaN where a cell is empty."""
    values = array("d")
    number = _HEAD_LINES
    while line := stream.readline(LONGEST_LINE):
        number += 1
        if not line.strip():
            continue
        cells = line.split("\t", 1 + width)[1 : 1 + width]
        cells += [""] * (width - len(cells))
        try:
            values.extend([float(cell) if cell.strip() else math.nan for cell in cells])
        except ValueError as error:
            raise BadInput(f"{name}, line {number}: a number is expected in each field") from error
        if len(values) > MOST_CELLS:
            raise BadInput(f"{name} has more than {MOST_CELLS} numbers; divide it, or leave markers out")
    return np.array(values).reshape(-1, width)


def _unit(vectors: np.ndarray) -> np.ndarray:
    """NaN where markers coincide: then there is no direction."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(length > SHORTEST_MM * 1e-3, length, np.nan)


def _between(at: np.ndarray, time_s: np.ndarray, places: np.ndarray) -> np.ndarray:
    seen = np.isfinite(places).all(axis=1)
    known = time_s[seen]
    if len(known) < 2:
        return np.full((len(at), 3), np.nan)
    after = np.clip(np.searchsorted(known, at), 1, len(known) - 1)
    usable = (
        (at >= known[0]) & (at <= known[-1]) & (known[after] - known[after - 1] <= LONGEST_INTERPOLATED_GAP_S)
    )
    found = np.column_stack([np.interp(at, known, column) for column in places[seen].T])
    return np.where(usable[:, None], found, np.nan)
