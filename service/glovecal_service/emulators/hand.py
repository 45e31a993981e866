"""The simulated hand as a function of time, for emulated gloves. Nothing of it was measured on a person."""

from __future__ import annotations

from itertools import count

import numpy as np

from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG
from glovecal_models.simulation.protocol import free_segment
from glovecal_models.simulation.simulated_hand import ROTATIONS, SimulatedHand
from glovecal_models.simulation.simulated_take import Performance

_GRID_HZ = 120
_BLOCK = 120
_SEGMENT_S = 20.0


class MovingHand:
    """A person's free motion, fixed by ``seed``, for ever."""

    def __init__(self, seed: int = 0) -> None:
        motion = (free_segment(seed, _SEGMENT_S, part) for part in count())
        self._performance = Performance(SimulatedHand(seed), motion, ROTATIONS)
        self._block = -1
        self._angles = np.empty((0, len(ROTATIONS)))

    def degrees(self, time_s: float) -> dict[str, float]:
        """Every rotation at ``time_s`` from the start, which is 0; worked out a second at a time."""
        sample = max(0, int(time_s * _GRID_HZ))
        if sample // _BLOCK != self._block:
            self._block = sample // _BLOCK
            numbers = np.arange(self._block * _BLOCK, (self._block + 1) * _BLOCK)
            self._angles = self._performance.at(numbers / _GRID_HZ)[0]
        return dict(zip(ROTATIONS, self._angles[sample % _BLOCK].tolist(), strict=True))

    def bent(self, time_s: float) -> dict[str, float]:
        """Every rotation as its share of the joint's active range, 0 to 1."""
        shares = {}
        for name, degrees in self.degrees(time_s).items():
            low, high = ACTIVE_RANGE_DEG[name]
            shares[name] = min(1.0, max(0.0, (degrees - low) / (high - low)))
        return shares
