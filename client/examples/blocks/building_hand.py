"""The script of a hand that builds a pyramid of six: angles for the stream, and the place of the wrist."""

from __future__ import annotations

import numpy as np
from stream.simulated_hand import Script

from blocks.desk import EDGE_MM, pinch_mm
from glovecal_models.hand.rotations import HAND_ROTATIONS, completed

_REST = {
    "R_MCP": 85,
    "R_PIP": 95,
    "P_MCP": 85,
    "P_PIP": 95,
    "MR_ABD": 0,
    "RP_ABD": 0,
    "W_FLEX": 0,
    "W_ABD": 0,
}


def _angles(**bends: float) -> np.ndarray:
    angles = {**bends, **_REST}
    return completed(list(angles), np.array([list(angles.values())], float))[0]


OPEN_DEG = _angles(
    T_TMC=60.0, TI_ABD=28.8, T_MCP=2.7, T_IP=10.0,
    I_MCP=27.9, I_PIP=60.6, M_MCP=25.5, M_PIP=68.1, IM_ABD=0.0,
)  # fmt: skip
"""Thumb 60 mm from index and middle finger."""
HOLDING_DEG = _angles(
    T_TMC=60.0, TI_ABD=25.3, T_MCP=6.5, T_IP=12.7,
    I_MCP=42.9, I_PIP=52.4, M_MCP=37.8, M_PIP=61.5, IM_ABD=0.0,
)  # fmt: skip
"""36 mm: with round fingertips of 8 mm it presses 5 mm into both sides of a block."""

GAP_MM = 8.0
_PITCH = EDGE_MM + GAP_MM
PYRAMID_MM = np.array(
    [
        [column * _PITCH - row_length, 0.0, (level + 0.5) * EDGE_MM]
        for level, (count, row_length) in enumerate([(3, _PITCH), (2, _PITCH / 2), (1, 0.0)])
        for column in range(count)
    ]
)
"""(6, 3): where each block is to go, in the order of building."""
START_MM = np.array([[x, -140.0, EDGE_MM / 2] for x in (-150.0, -90.0, -30.0, 30.0, 90.0, 150.0)])
"""(6, 3): where the blocks lie at the beginning."""
ABOVE_MM, SET_DOWN_MM = 130.0, 1.0
"""How high the hand travels, and how far over its place a block is let go."""
WAYS_S = {"travel": 0.6, "down": 0.5, "grip": 0.4, "lift": 0.5, "carry": 0.7, "lower": 0.7, "release": 0.4}


class BuildingHand:
    """``script`` gives angles by rotation, ``hand_mm`` the wrist, both at a time in seconds."""

    def __init__(self) -> None:
        self._times, self._shapes, self._pinches = [0.0], [OPEN_DEG], [np.array([0.0, -60.0, ABOVE_MM])]
        for lying, goal in zip(START_MM, PYRAMID_MM, strict=True):
            let_go = goal + np.array([0.0, 0.0, SET_DOWN_MM])
            self._go("travel", _above(lying), OPEN_DEG)
            self._go("down", lying, OPEN_DEG)
            self._go("grip", lying, HOLDING_DEG)
            self._go("lift", _above(lying), HOLDING_DEG)
            self._go("carry", _above(let_go), HOLDING_DEG)
            self._go("lower", let_go, HOLDING_DEG)
            self._go("release", let_go, OPEN_DEG)
            self._go("lift", _above(let_go), OPEN_DEG)
        self.lasts_s = self._times[-1]

    @property
    def script(self) -> Script:
        def angles(seconds: float) -> dict[str, float]:
            return dict(zip(HAND_ROTATIONS, self._at(seconds, self._shapes).tolist(), strict=True))

        return angles

    def hand_mm(self, seconds: float, angles_deg: np.ndarray) -> np.ndarray:
        """The wrist, as a person moves it who sees the hand as drawn and brings its pinch to the block."""
        return self._at(seconds, self._pinches) - pinch_mm(angles_deg)

    def _go(self, way: str, pinch: np.ndarray, shape: np.ndarray) -> None:
        self._times.append(self._times[-1] + WAYS_S[way])
        self._pinches.append(pinch)
        self._shapes.append(shape)

    def _at(self, seconds: float, path: list[np.ndarray]) -> np.ndarray:
        """Between two places of the path, slow at both ends."""
        after = int(np.clip(np.searchsorted(self._times, seconds), 1, len(path) - 1))
        begin, end = self._times[after - 1], self._times[after]
        share = np.clip((seconds - begin) / (end - begin), 0.0, 1.0)
        return path[after - 1] + (path[after] - path[after - 1]) * (3 - 2 * share) * share**2


def _above(place: np.ndarray) -> np.ndarray:
    return np.array([place[0], place[1], ABOVE_MM])
