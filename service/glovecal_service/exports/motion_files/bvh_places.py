"""BVH read as places of its bones: whatever order a program turns them in, places mean the same."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_service.exports.body_markers import LONGEST_LINE, MOST_CELLS, BodyMarkers
from glovecal_service.exports.bvh import MM_PER_UNIT

MOST_BONES = 1000
MOST_HEAD_LINES = 8 * MOST_BONES
MOST_CHANNELS = 6
LONGEST_STEP_S = 10.0
FRAMES_AT_ONCE = 4096
TURNS, SHIFTS = ("Xrotation", "Yrotation", "Zrotation"), ("Xposition", "Yposition", "Zposition")
RIGHT = "is this a BVH file, whole? Export it again"


@dataclass
class Bone:
    name: str
    parent: int | None
    offset: np.ndarray = field(default_factory=lambda: np.zeros(3))
    channels: tuple[str, ...] = ()


def read_bvh(path: Path, name: str) -> BodyMarkers:
    """Places in the file's unit, taken as cm; the end of a bone is called after it, with ``end``. Time begins
    at 0. Raises BadInput that names ``name``, the line and what would be right."""
    with path.open(encoding="utf-8-sig", errors="replace") as stream:
        lines = _Lines(stream, name)
        bones = _hierarchy(lines)
        count = lines.number("Frames:")
        step_s = lines.number("Frame Time:")
        if not 0.0 < step_s <= LONGEST_STEP_S:
            raise lines.problem(f"a frame time of {step_s:g} s; give more than 0, {LONGEST_STEP_S:g} at most")
        values = _rows(lines, sum(len(bone.channels) for bone in bones))
    if len(values) < 2 or len(values) != count:
        raise BadInput(f"{name} has {len(values)} of {count:g} frames: it needs two or more, {RIGHT}")
    if not np.isfinite(values).all():
        raise BadInput(f"{name} has a value that is not finite; write the file again")
    if 3 * len(bones) * len(values) > MOST_CELLS:
        raise BadInput(f"{name} has more than {MOST_CELLS} numbers; divide it into shorter files")
    blocks = [
        _places(bones, values[at : at + FRAMES_AT_ONCE]) for at in range(0, len(values), FRAMES_AT_ONCE)
    ]
    places = np.concatenate(blocks) * MM_PER_UNIT
    return BodyMarkers(
        step_s * np.arange(len(values)), {bone.name: places[:, at] for at, bone in enumerate(bones)}
    )


class _Lines:
    """Lines that are not empty, and where they stand."""

    def __init__(self, stream: TextIO, name: str) -> None:
        self._stream, self._name, self._at = stream, name, 0

    def next(self) -> str | None:
        while line := self._stream.readline(LONGEST_LINE):
            self._at += 1
            if line.strip():
                return line.strip()
        return None

    def problem(self, what: str) -> BadInput:
        return BadInput(f"{self._name}, line {self._at}: {what}")

    def number(self, key: str) -> float:
        """Of a line such as ``Frames: 300``."""
        line = self.next() or ""
        if not line.startswith(key):
            raise self.problem(f"{line[:40]!r}, where {key!r} was expected; {RIGHT}")
        return self.numbers(line.removeprefix(key), 1)[0]

    def numbers(self, text: str, count: int) -> list[float]:
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            raise self.problem(f"{text[:40]!r} must be {count} numbers") from None
        if len(values) != count:
            raise self.problem(f"{len(values)} numbers, {count} were expected; {RIGHT}")
        return values


def _hierarchy(lines: _Lines) -> list[Bone]:
    """Parents before children. Reads up to the line ``MOTION``."""
    if lines.next() != "HIERARCHY":
        raise lines.problem("a BVH file begins with HIERARCHY")
    bones: list[Bone] = []
    above: list[int] = []
    for _ in range(MOST_HEAD_LINES):
        line = lines.next()
        if line is None:
            raise lines.problem(f"the file ends in its skeleton; {RIGHT}")
        word, _, rest = line.partition(" ")
        if line == "MOTION":
            if above or not bones:
                raise lines.problem(f"MOTION, before the skeleton is closed; {RIGHT}")
            return bones
        if word in ("ROOT", "JOINT", "End"):
            parent = above[-1] if above else None
            named = f"{bones[parent].name} end" if word == "End" and parent is not None else rest.strip()
            bones.append(Bone(named, parent))
        elif word == "{":
            above.append(len(bones) - 1)
        elif word == "}" and above:
            above.pop()
        elif word == "OFFSET" and bones:
            bones[-1].offset = np.array(lines.numbers(rest, 3))
        elif word == "CHANNELS" and bones:
            channels = rest.split()[1:]
            if len(channels) > MOST_CHANNELS:
                raise lines.problem(f"{len(channels)} channels; at most {MOST_CHANNELS} are expected")
            for channel in channels:
                if channel not in (*SHIFTS, *TURNS):
                    near = did_you_mean(channel[:40], (*SHIFTS, *TURNS))
                    raise lines.problem(f"no channel {channel[:40]!r}; {near}")
            bones[-1].channels = tuple(channels)
        else:
            raise lines.problem(f"{line[:40]!r} is nothing that a skeleton has; {RIGHT}")
        if len(bones) > MOST_BONES:
            raise lines.problem(f"more than {MOST_BONES} bones; leave some out")
    raise lines.problem(f"the skeleton has more than {MOST_HEAD_LINES} lines; leave bones out")


def _rows(lines: _Lines, width: int) -> np.ndarray:
    """(N, width)."""
    values = array("d")
    while (line := lines.next()) is not None:
        values.extend(lines.numbers(line, width))
        if len(values) > MOST_CELLS:
            raise lines.problem(f"more than {MOST_CELLS} numbers; divide it into shorter files")
    return np.array(values).reshape(-1, width) if width else np.empty((0, 0))


def _places(bones: list[Bone], values: np.ndarray) -> np.ndarray:
    """(N, len(bones), 3), in the file's unit."""
    places = np.empty((len(values), len(bones), 3))
    turned = np.empty((len(bones), len(values), 3, 3))
    column = 0
    for at, bone in enumerate(bones):
        own, shift = np.broadcast_to(np.eye(3), (len(values), 3, 3)), np.tile(bone.offset, (len(values), 1))
        is_placed = any(channel in SHIFTS for channel in bone.channels)
        if is_placed:
            shift[:] = 0.0 if bone.parent is None else bone.offset
        for channel in bone.channels:
            value = values[:, column]
            column += 1
            if channel in SHIFTS:
                shift[:, SHIFTS.index(channel)] = value
            else:
                own = own @ _turn(TURNS.index(channel), np.radians(value))
        if bone.parent is None:
            places[:, at], turned[at] = shift, own
        else:
            places[:, at] = places[:, bone.parent] + np.einsum("nij,nj->ni", turned[bone.parent], shift)
            turned[at] = turned[bone.parent] @ own
    return places


def _turn(axis: int, angle: np.ndarray) -> np.ndarray:
    """(N, 3, 3) about one axis, radians."""
    values = np.zeros((len(angle), 3, 3))
    one, other = (axis + 1) % 3, (axis + 2) % 3
    values[:, axis, axis] = 1.0
    values[:, one, one] = values[:, other, other] = np.cos(angle)
    values[:, other, one] = np.sin(angle)
    values[:, one, other] = -np.sin(angle)
    return values
