"""What a camera says about a hand over time, and the file that holds it.

The file is a NumPy archive (.npz) without pickled objects, written by the live source of a camera:

| array | shape | holds |
|---|---|---|
| ``version`` | () | 1 |
| ``time_s`` | (F,) | seconds of the camera's own clock, the middle of the exposure |
| ``rotations`` | (K,) | names of rotations, text |
| ``angles_deg``, ``sd_deg`` | (F, K) | estimates and their standard deviations; NaN: no hand found |
| ``accepted`` | (F, K) | whether each is sure enough to be a reference |
| ``patches`` | (F,) | how many patches of the glove were seen; -1 where that is not known |
| ``simulated`` | () | whether no camera saw this: simulated or rendered |

Which angles a reference with stated deviations saw: outside of them it judges nothing.
"""

from __future__ import annotations

import io
import os
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from glovecal_models.documents import UNREADABLE_ARCHIVE
from glovecal_models.errors import BadInput, reason_of
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.names import check_channel_name
from glovecal_models.presentation.document import answer
from glovecal_models.takes.take import Take

VERSION = 1
MOST_FRAMES = 1_000_000
"""Nine hours at 30 frames a second."""
MOST_ROTATIONS = 64
LARGEST_ESTIMATES = 1 << 30
"""Of all arrays, unpacked."""
_SHAPES = {"time_s": "F", "angles_deg": "FK", "sd_deg": "FK", "accepted": "FK", "patches": "F"}
_PLAIN = ("version", "rotations", "simulated")
ALIKE_S = 0.3
"""Errors of a camera last so long: samples nearer than this count as one."""
BIN_DEG = 5.0
FEWEST_IN_BIN = 3
"""Effective samples from which a range of ``BIN_DEG`` counts as seen."""
BRIDGED_DEG = 10.0
"""Ranges no further apart are one: a smooth map is known between its samples."""
NOTEWORTHY_DEG = 10.0
"""So much of a joint's active range may be missing at one end before it is said."""


@dataclass(frozen=True, eq=False)
class CameraEstimates:
    """F frames of a camera and K rotations. Raises BadInput for arrays that cannot be."""

    time_s: np.ndarray
    """(F,), seconds of the camera's clock, increasing: the middle of each exposure."""
    rotations: tuple[str, ...]
    angles_deg: np.ndarray
    """(F, K); NaN where the hand was not found."""
    sd_deg: np.ndarray
    """(F, K), standard deviations."""
    accepted: np.ndarray
    """(F, K) bool: sure enough to be a reference."""
    patches: np.ndarray
    """(F,) int, how many patches of the glove were seen; -1: not known."""
    simulated: bool = False
    """Whether no camera saw this: simulated or rendered."""

    def __post_init__(self) -> None:
        frames, columns = len(self.time_s), len(self.rotations)
        if not 0 < frames <= MOST_FRAMES or not 0 < columns <= MOST_ROTATIONS:
            raise BadInput(
                f"{frames} frames of {columns} rotations; 1 to {MOST_FRAMES} frames of 1 to {MOST_ROTATIONS} "
                "rotations are kept"
            )
        for name in self.rotations:
            check_channel_name(name, "rotation")
        if len(set(self.rotations)) != columns:
            raise BadInput("a rotation stands twice among the camera's estimates; each is given once")
        for name, letters in _SHAPES.items():
            shape = tuple({"F": frames, "K": columns}[letter] for letter in letters)
            if getattr(self, name).shape != shape:
                raise BadInput(f"{name} has shape {getattr(self, name).shape}, expected {shape}")
        back = np.flatnonzero(~(np.diff(self.time_s) > 0))
        if not np.isfinite(self.time_s).all() or len(back):
            row = int(back[0]) + 1 if len(back) else int(np.argmax(~np.isfinite(self.time_s)))
            raise BadInput(f"frame {row} of the camera is stamped {self.time_s[row]:g} s; time must increase")
        known = self.accepted & ~((self.sd_deg > 0) & np.isfinite(self.sd_deg) & np.isfinite(self.angles_deg))
        if known.any():
            row, column = np.argwhere(known)[0]
            angle, deviation = self.angles_deg[row, column], self.sd_deg[row, column]
            raise BadInput(
                f"frame {row} of the camera accepts {self.rotations[column]} at {angle:g} with a standard "
                f"deviation of {deviation:g}; both must be finite degrees, and the deviation positive"
            )
        if (np.abs(self.angles_deg[self.accepted]) > 360.0).any():
            raise BadInput("an accepted angle of the camera exceeds 360 degrees; they are wanted in degrees")

    @property
    def interval_s(self) -> float:
        """Usual time between frames; 0 for a single one."""
        return float(np.median(np.diff(self.time_s))) if len(self.time_s) > 1 else 0.0


def without_repeats(time_s: np.ndarray) -> np.ndarray:
    """(F,) which frames are stamped later than all before them: others were stamped twice, or out of
    order."""
    latest = np.maximum.accumulate(np.concatenate([[-np.inf], time_s[:-1]]))
    return time_s > latest


def write_estimates(estimates: CameraEstimates, path: Path) -> None:
    """Write the file; one already there is replaced only when the new one is complete."""
    part = path.with_name(f"{path.name}.part")
    arrays: dict[str, Any] = {name: np.ascontiguousarray(getattr(estimates, name)) for name in _SHAPES}
    try:
        with part.open("wb") as stream:
            np.savez_compressed(
                stream,
                version=np.array(VERSION),
                rotations=np.array(estimates.rotations, dtype=np.str_),
                simulated=np.array(estimates.simulated),
                **arrays,
            )
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def read_estimates(path: Path) -> CameraEstimates:
    """The file's estimates; frames stamped twice are left out. Nothing is unpickled. Raises BadInput."""
    try:
        content = path.read_bytes() if path.stat().st_size <= LARGEST_ESTIMATES else b""
    except OSError as error:
        raise BadInput(f"{path.name} cannot be read: {reason_of(error)}") from error
    if not content:
        raise BadInput(f"{path.name} is empty, or larger than {LARGEST_ESTIMATES} bytes")
    return _checked(_arrays(content, path.name), path.name)


def _arrays(content: bytes, name: str) -> dict[str, np.ndarray]:
    wanted = {*_SHAPES, *_PLAIN}
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            sizes = {item.filename.removesuffix(".npy"): item.file_size for item in archive.infolist()}
        arrays = {}
        if set(sizes) == wanted and sum(sizes.values()) <= LARGEST_ESTIMATES:
            with np.load(io.BytesIO(content), allow_pickle=False) as archive:
                arrays = {key: archive[key] for key in wanted}
    except UNREADABLE_ARCHIVE as error:
        raise BadInput(
            f"{name} is no whole file of a camera's estimates (.npz), or was damaged; send it again"
        ) from error
    if not arrays:
        raise BadInput(
            f"{name} holds {', '.join(sorted(sizes))[:200]}; a camera's estimates are "
            f"{', '.join(sorted(wanted))}, of {LARGEST_ESTIMATES} bytes at most"
        )
    return arrays


def _checked(arrays: dict[str, np.ndarray], name: str) -> CameraEstimates:
    version = arrays["version"]
    if version.shape != () or version.dtype.kind not in "iu" or int(version) != VERSION:
        raise BadInput(f"{name} has another version than {VERSION}, which this software reads")
    kinds = {"rotations": "U", "accepted": "b", "simulated": "b", "patches": "iu"}
    for key, array in arrays.items():
        if array.dtype.kind not in kinds.get(key, "fiu"):
            raise BadInput(f"{name}: {key} holds {array.dtype}; numbers, names and yes or no are expected")
        if array.ndim != {"F": 1, "FK": 2}.get(_SHAPES.get(key, ""), 1 if key == "rotations" else 0):
            raise BadInput(f"{name}: {key} has shape {array.shape}")
    frames = len(arrays["time_s"])
    if any(len(arrays[key]) != frames for key in _SHAPES):
        raise BadInput(f"{name}: its arrays tell of different numbers of frames")
    kept = without_repeats(arrays["time_s"]) & np.isfinite(arrays["time_s"])
    return CameraEstimates(
        time_s=arrays["time_s"][kept].astype(float),
        rotations=tuple(map(str, arrays["rotations"])),
        angles_deg=arrays["angles_deg"][kept].astype(float),
        sd_deg=arrays["sd_deg"][kept].astype(float),
        accepted=arrays["accepted"][kept],
        patches=arrays["patches"][kept].astype(int),
        simulated=bool(arrays["simulated"]),
    )


@answer
class CoveredRange:
    """Which angles of one rotation a camera accepted over some takes."""

    rotation: str
    ranges_deg: Sequence[tuple[float, float]]
    """From low to high; angles outside are not judged. Empty: too little was accepted."""
    effective_samples: int
    """Accepted samples; those within 0.3 s count as one."""
    sd_deg: float | None
    """RMS of the stated standard deviations; null: nothing was accepted."""
    sentence: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "sentence", self._sentence())

    @property
    def low_deg(self) -> float:
        return self.ranges_deg[0][0] if self.ranges_deg else float("nan")

    @property
    def high_deg(self) -> float:
        return self.ranges_deg[-1][1] if self.ranges_deg else float("nan")

    def holds(self, angles_deg: np.ndarray) -> np.ndarray:
        """(N,) whether each of ``angles_deg`` (N,) lies in a range that was seen."""
        inside = np.zeros(len(angles_deg), dtype=bool)
        for low, high in self.ranges_deg:
            inside |= (angles_deg >= low) & (angles_deg <= high)
        return inside

    def _sentence(self) -> str:
        if not self.ranges_deg:
            return f"{self.rotation}: the camera accepted too little to judge it at any angle."
        seen = " and ".join(f"{low:.0f} to {high:.0f}" for low, high in self.ranges_deg)
        text = f"{self.rotation}: the camera saw {seen} degrees; other angles are not judged."
        active = ACTIVE_RANGE_DEG.get(self.rotation)
        if active is None:
            return text
        if active[1] - self.high_deg > NOTEWORTHY_DEG:
            what = "deep flexion" if self.rotation.endswith(("MCP", "PIP", "DIP", "IP")) else "this end"
            text += f" It never saw {what} ({self.high_deg:.0f} to {active[1]:.0f} degrees)."
        return text


def covered_ranges(takes: Sequence[Take], rotations: Sequence[str]) -> tuple[CoveredRange, ...]:
    """Of the ``rotations`` that some take measured with a stated deviation."""
    found = []
    for rotation in rotations:
        angles, squares, stated = [], [], False
        for take in takes:
            if take.reference_sd is None or rotation not in take.rotations:
                continue
            column = take.rotations.index(rotation)
            deviation = take.reference_sd[:, column]
            known = np.isfinite(take.reference[:, column]) & np.isfinite(deviation)
            stated |= bool(np.isfinite(deviation).any())
            rows = thinned(take.reference_time_s, np.flatnonzero(known))
            angles.append(take.reference[rows, column])
            squares.append(deviation[known] ** 2)
        if stated:
            every = np.concatenate(angles)
            square = np.concatenate(squares)
            spread = float(np.sqrt(np.mean(square))) if len(square) else None
            found.append(CoveredRange(rotation, _ranges(every), len(every), spread))
    return tuple(found)


def thinned(time_s: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Those of ``rows`` (increasing) that lie at least ``ALIKE_S`` apart, the first among them."""
    kept: list[int] = []
    time = time_s[rows]
    place = 0
    while place < len(rows):
        kept.append(int(rows[place]))
        place = int(np.searchsorted(time, time[place] + ALIKE_S - 1e-9))
    return np.array(kept, dtype=int)


def _ranges(angles: np.ndarray) -> tuple[tuple[float, float], ...]:
    """Neighbouring bins with enough samples, joined; the ends where samples end."""
    if not len(angles):
        return ()
    first = int(np.floor(angles.min() / BIN_DEG))
    counts = np.bincount(np.floor(angles / BIN_DEG).astype(int) - first)
    seen = np.flatnonzero(counts >= FEWEST_IN_BIN)
    if not len(seen):
        return ()
    apart = np.flatnonzero(np.diff(seen) > 1 + round(BRIDGED_DEG / BIN_DEG)) + 1
    found = []
    for run in np.split(seen, apart):
        low, high = (first + run[0]) * BIN_DEG, (first + run[-1] + 1) * BIN_DEG
        inside = angles[(angles >= low) & (angles < high)]
        found.append((float(inside.min()), float(inside.max())))
    return tuple(found)
