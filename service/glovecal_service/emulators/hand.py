"""The simulated hand as a function of time, for emulated gloves. Nothing of it was measured on a person.

Raw counts of a simulated hand in an emulated CyberGlove. Nothing here was measured on a person.

Spans per kind of joint lie within those computed from public calibration files of three gloves of two
laboratories (asr left and right, shadow): flexion 0.5 to 1.8 counts per degree, thumb-index abduction 7 to 8,
other abduction 0.4 to 3, straight-hand counts 32 to 117, fists 72 to 209. Flexion raises the count, spreading
the fingers lowers it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count

import numpy as np

from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.simulation.protocol import free_segment
from glovecal_models.simulation.simulated_glove import Performance
from glovecal_models.simulation.simulated_hand import ROTATIONS, SimulatedHand

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


SIMULATED = True


@dataclass(frozen=True)
class Span:
    """One sensor: count of the flat hand, counts per degree, and the joint's range in degrees."""

    zero: float
    counts_per_degree: float
    low: float
    high: float

    def count(self, degrees: float) -> int:
        """The 8-bit count for an angle; the hardware never sends 0."""
        return max(1, min(255, round(self.zero + self.counts_per_degree * degrees)))


SPAN_OF_BIT = {
    0: Span(95, 0.9, -20, 60),  # thumb roll
    1: Span(70, 0.8, 0, 60),
    2: Span(60, 0.9, 0, 80),
    3: Span(210, -7.0, 0, 22),  # thumb-index abduction
    4: Span(75, 0.9, 0, 90),
    5: Span(60, 1.4, 0, 100),
    6: Span(50, 0.8, 0, 70),
    8: Span(70, 0.8, 0, 90),
    9: Span(62, 1.3, 0, 100),
    10: Span(48, 0.7, 0, 70),
    11: Span(150, -2.4, -5, 25),
    12: Span(72, 0.7, 0, 90),
    13: Span(58, 1.5, 0, 100),
    14: Span(45, 0.9, 0, 70),
    15: Span(145, -2.2, -5, 25),
    16: Span(80, 0.7, 0, 90),
    17: Span(66, 1.3, 0, 95),
    18: Span(52, 0.6, 0, 70),
    19: Span(140, -2.0, -5, 30),
    20: Span(100, 0.9, 0, 40),  # palm arch
    21: Span(128, 1.0, -60, 60),  # wrist pitch
    22: Span(128, 1.6, -25, 25),  # wrist yaw
}


def counts_at(time_s: float) -> dict[int, int]:
    """The count of every sensor, by bit number: slow opening and closing, each joint in its own way."""
    counts = {}
    for bit, span in SPAN_OF_BIT.items():
        phase = 2 * math.pi * (0.35 + 0.013 * bit) * time_s + 0.7 * bit
        degrees = span.low + (span.high - span.low) * (0.5 - 0.5 * math.cos(phase))
        counts[bit] = span.count(degrees)
    return counts


ROTATION_OF_BIT = {
    0: "T_TMC", 1: "T_MCP", 2: "T_IP", 3: "TI_ABD", 4: "I_MCP", 5: "I_PIP", 6: "I_DIP",
    8: "M_MCP", 9: "M_PIP", 10: "M_DIP", 11: "IM_ABD", 12: "R_MCP", 13: "R_PIP", 14: "R_DIP", 15: "MR_ABD",
    16: "P_MCP", 17: "P_PIP", 18: "P_DIP", 19: "RP_ABD", 20: "PALM_ARCH", 21: "W_FLEX", 22: "W_ABD",
}  # fmt: skip
"""The joint that moves each sensor; the order of the hardware, from the fact sheet's table."""


def count_of_joint(bit: int, degrees: Mapping[str, float]) -> float:
    """The unrounded 8-bit count of a sensor in a hand with these rotations."""
    span = SPAN_OF_BIT[bit]
    return span.zero + span.counts_per_degree * min(span.high, max(span.low, degrees[ROTATION_OF_BIT[bit]]))


def counts_of_hand(degrees: Mapping[str, float]) -> dict[int, int]:
    """The count of every sensor, by bit number."""
    return {bit: max(1, min(255, round(count_of_joint(bit, degrees)))) for bit in SPAN_OF_BIT}
