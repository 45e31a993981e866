"""Which angles a reference with stated deviations saw: outside of them it judges nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG
from glovecal_models.takes.take import Take

ALIKE_S = 0.3
"""Errors of a camera last so long: samples nearer than this count as one."""
BIN_DEG = 5.0
FEWEST_IN_BIN = 3
"""Effective samples from which a range of ``BIN_DEG`` counts as seen."""
BRIDGED_DEG = 10.0
"""Ranges no further apart are one: a smooth map is known between its samples."""
NOTEWORTHY_DEG = 10.0
"""So much of a joint's active range may be missing at one end before it is said."""


@dataclass(frozen=True)
class CoveredRange:
    """Of one rotation over some takes."""

    rotation: str
    ranges_deg: tuple[tuple[float, float], ...]
    """Ranges seen, from low to high; none where too little was accepted."""
    effective_samples: int
    """Accepted samples, of which those within ``ALIKE_S`` count as one."""
    deviation_deg: float
    """RMS of the stated standard deviations; NaN where nothing was accepted."""

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

    def sentence(self) -> str:
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
            spread = float(np.sqrt(np.mean(np.concatenate(squares))))
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
