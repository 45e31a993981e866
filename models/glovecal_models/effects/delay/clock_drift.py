"""Clock drift: the reference clock runs faster or slower than the glove's, seen in takes of a minute or more.

Reference time = frame time + offset + drift x (frame time - middle of the take). Searched coarsely over the
drift, then polished together with the offset, by the same measure as the offset alone: what a linear map of
the sensors leaves unexplained. It counts only when it pays and when the first and the last third of the take,
each by itself, want offsets that differ accordingly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.takes.clock_scan import FINE_S, WORTHWHILE, Grid, on_grid, unexplained
from glovecal_models.takes.take import Take

SHORTEST_DRIFT_S = 60.0
LARGEST_PPM = 2000.0
END_STEP_S = 0.02
"""Between neighbouring drifts of the search, at either end of the take."""
LEAST_SHIFT_S = 0.01
"""Less from end to end is not worth a repair."""
THIRDS_WITHIN_S = 0.15
AGREE_WITHIN = 0.5


@dataclass(frozen=True)
class ClockDrift:
    """A take's clock with a drift that pays."""

    take: str
    offset_s: float
    """In the middle of the take."""
    drift_ppm: float
    middle_s: float
    """Frame time at which the offset holds."""
    unexplained_before: float
    """Share of the reference's variance that a linear map leaves with the offset alone."""
    unexplained_after: float

    @property
    def sentence(self) -> str:
        faster = "faster" if self.drift_ppm > 0 else "slower"
        return (
            f"Take {self.take}: the reference clock runs {abs(self.drift_ppm):.0f} ppm {faster} than the "
            f"glove's, with an offset of {self.offset_s:+.3f} s in the middle of the take."
        )


def clock_drift(take: Take, offset_s: float) -> ClockDrift | None:
    """The drift about a known offset, or None when the take is too short or a drift does not pay."""
    grid = on_grid(take)
    if grid is None or take.duration_s < SHORTEST_DRIFT_S:
        return None
    middle = float(grid.time_s.mean())
    half = take.duration_s / 2.0

    def left(offset: float, end_shift: float) -> float:
        at = grid.time_s + offset + end_shift / half * (grid.time_s - middle)
        share = unexplained(grid, grid.readings, at)
        return share if np.isfinite(share) else 1.0

    steps = int(np.ceil(LARGEST_PPM * 1e-6 * half / END_STEP_S))
    coarse = END_STEP_S * np.arange(-steps, steps + 1)
    start = float(coarse[int(np.argmin([left(offset_s, shift) for shift in coarse]))])
    without = _polished_offset(left, offset_s)
    from scipy.optimize import minimize  # slow to load, and each service loads all effects

    simplex = [(offset_s, start), (offset_s + END_STEP_S, start), (offset_s, start + END_STEP_S)]
    best = minimize(
        lambda pair: left(*pair), (offset_s, start), method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 5e-4, "fatol": 1e-9, "maxfev": 120},
    )  # fmt: skip
    offset, end_shift = (float(value) for value in best.x)
    before, after = left(without, 0.0), float(best.fun)
    if after > WORTHWHILE * before or abs(end_shift) < LEAST_SHIFT_S / 2.0:
        return None
    drift = end_shift / half
    if abs(drift) > LARGEST_PPM * 1e-6 or not _thirds_agree(grid, offset, drift, middle):
        return None
    return ClockDrift(take.name, offset, 1e6 * drift, middle, before, after)


def without_drift(take: Take, clock: ClockDrift) -> Take:
    """The take with its reference on the frames' clock."""
    drift = clock.drift_ppm * 1e-6
    time = (take.reference_time_s - clock.offset_s + drift * clock.middle_s) / (1.0 + drift)
    return replace(take, reference_time_s=time)


def _polished_offset(left: Callable[[float, float], float], offset_s: float) -> float:
    offsets = offset_s + FINE_S * np.arange(-8, 9)
    return float(offsets[int(np.argmin([left(offset, 0.0) for offset in offsets]))])


def _thirds_agree(grid: Grid, offset_s: float, drift: float, middle_s: float) -> bool:
    """Whether the first and the last third want offsets that differ as the drift says."""
    third = len(grid.time_s) // 3
    wanted, centres = [], []
    for part in (slice(0, third), slice(-third, None)):
        piece = replace(grid, time_s=grid.time_s[part], readings=grid.readings[part])
        centre = float(piece.time_s.mean())
        offsets = offset_s + np.arange(-THIRDS_WITHIN_S, THIRDS_WITHIN_S + FINE_S, FINE_S)
        offsets = offsets + drift * (centre - middle_s)
        shares = [unexplained(piece, piece.readings, piece.time_s + offset) for offset in offsets]
        if not np.isfinite(shares).any():
            return False
        wanted.append(float(offsets[int(np.nanargmin(shares))]))
        centres.append(centre)
    measured = (wanted[1] - wanted[0]) / (centres[1] - centres[0])
    return abs(measured - drift) <= AGREE_WITHIN * abs(drift)
