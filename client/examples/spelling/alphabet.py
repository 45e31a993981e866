"""The American manual alphabet as angles of the hand's rotations: 24 static letters.

Written down from what the letters look like, not measured on signers. J and Z are drawn in the air and are
left out: J has the shape of I, Z that of D's index finger. H and U, G and Q, K and P share their finger shape
and differ in where the hand points, which only a glove that measures the wrist can tell.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.hand.rotations import HAND_ROTATIONS, completed

_OPEN, _CLOSED = (0, 5), (85, 95)
_ACROSS = {"T_TMC": 45, "TI_ABD": 15, "T_MCP": 35, "T_IP": 45}
"""The thumb over bent fingers."""
_BESIDE = {"T_TMC": 10, "TI_ABD": 5, "T_MCP": 5, "T_IP": 5}
"""The thumb along the side of the fist."""
_OUT = {"T_TMC": 10, "TI_ABD": 60, "T_MCP": 5, "T_IP": 5}
_TOUCHES = {"T_TMC": 50, "TI_ABD": 35, "T_MCP": 25, "T_IP": 25}
"""The thumb's tip against fingertips."""

_Bend = tuple[int, int]
_Thumb = dict[str, int]


def _shape(
    index: _Bend, middle: _Bend, ring: _Bend, little: _Bend, thumb: _Thumb, spread: int = 0, **more: int
) -> dict[str, int]:
    """A letter: knuckle and middle joint of each finger, thumb, spread between fingers, other rotations."""
    bends = dict(zip("IMRP", (index, middle, ring, little), strict=True))
    angles = {f"{finger}_MCP": bend[0] for finger, bend in bends.items()}
    angles |= {f"{finger}_PIP": bend[1] for finger, bend in bends.items()}
    spreads = {"IM_ABD": spread, "MR_ABD": spread, "RP_ABD": spread}
    return angles | spreads | thumb | {"W_FLEX": 0, "W_ABD": 0} | more


_CURLED, _ROUND = (35, 100), (45, 45)
SHAPES: dict[str, dict[str, int]] = {
    "A": _shape(_CLOSED, _CLOSED, _CLOSED, _CLOSED, _BESIDE),
    "B": _shape(_OPEN, _OPEN, _OPEN, _OPEN, {"T_TMC": 55, "TI_ABD": 10, "T_MCP": 35, "T_IP": 40}),
    "C": _shape((25, 50), (25, 50), (25, 50), (25, 50), {"T_TMC": 50, "TI_ABD": 50, "T_MCP": 5, "T_IP": 15}),
    "D": _shape(_OPEN, _ROUND, _ROUND, _ROUND, _TOUCHES),
    "E": _shape(_CURLED, _CURLED, _CURLED, _CURLED, {"T_TMC": 50, "TI_ABD": 5, "T_MCP": 40, "T_IP": 55}),
    "F": _shape((45, 55), _OPEN, _OPEN, _OPEN, _TOUCHES, 12),
    "G": _shape((5, 5), _CLOSED, _CLOSED, _CLOSED, {"T_TMC": 25, "TI_ABD": 30, "T_MCP": 5, "T_IP": 5}),
    "H": _shape(_OPEN, _OPEN, _CLOSED, _CLOSED, _ACROSS, W_FLEX=40),
    "I": _shape(_CLOSED, _CLOSED, _CLOSED, _OPEN, _ACROSS),
    "K": _shape(
        _OPEN, (40, 10), _CLOSED, _CLOSED, {"T_TMC": 35, "TI_ABD": 30, "T_MCP": 5, "T_IP": 5}, IM_ABD=10
    ),
    "L": _shape(_OPEN, _CLOSED, _CLOSED, _CLOSED, _OUT),
    "M": _shape((65, 60), (65, 60), (65, 60), _CLOSED, {"T_TMC": 58, "TI_ABD": 0, "T_MCP": 40, "T_IP": 30}),
    "N": _shape((65, 60), (65, 60), _CLOSED, _CLOSED, {"T_TMC": 50, "TI_ABD": 0, "T_MCP": 35, "T_IP": 20}),
    "O": _shape((50, 55), (50, 55), (50, 55), (50, 55), _TOUCHES),
    "P": _shape(
        _OPEN, (40, 10), _CLOSED, _CLOSED, {"T_TMC": 35, "TI_ABD": 30, "T_MCP": 5, "T_IP": 5},
        IM_ABD=10, W_FLEX=60,
    ),
    "Q": _shape(
        (5, 5), _CLOSED, _CLOSED, _CLOSED, {"T_TMC": 25, "TI_ABD": 30, "T_MCP": 5, "T_IP": 5}, W_FLEX=60
    ),
    "R": _shape((5, 10), (20, 15), _CLOSED, _CLOSED, _ACROSS, IM_ABD=-8),
    "S": _shape(_CLOSED, _CLOSED, _CLOSED, _CLOSED, _ACROSS),
    "T": _shape((65, 60), _CLOSED, _CLOSED, _CLOSED, {"T_TMC": 35, "TI_ABD": 0, "T_MCP": 20, "T_IP": 10}),
    "U": _shape(_OPEN, _OPEN, _CLOSED, _CLOSED, _ACROSS),
    "V": _shape(_OPEN, _OPEN, _CLOSED, _CLOSED, _ACROSS, IM_ABD=25),
    "W": _shape(_OPEN, _OPEN, _OPEN, _CLOSED, _ACROSS, IM_ABD=18, MR_ABD=18),
    "X": _shape((15, 80), _CLOSED, _CLOSED, _CLOSED, _ACROSS),
    "Y": _shape(_CLOSED, _CLOSED, _CLOSED, _OPEN, _OUT, RP_ABD=20),
}  # fmt: skip
LETTERS = "".join(SHAPES)
SAME_SHAPE = ("HU", "GQ", "KP")
"""Told apart by the wrist alone."""
HARD = "EMNST"
"""Those of Wang & Popovic 2009, section 6.1: the thumb under or over a closed hand."""


def _angles(shapes: dict[str, dict[str, int]]) -> np.ndarray:
    names = list(next(iter(shapes.values())))
    return completed(names, np.array([[shape[name] for name in names] for shape in shapes.values()], float))


LETTERS_DEG = _angles(SHAPES)
"""(24, R), in the order of LETTERS and of HAND_ROTATIONS."""
REST_ANGLES_DEG = completed([], np.empty((1, 0)))[0]
"""(R,): the relaxed hand, which is no letter."""
ROTATIONS_WITHOUT_WRIST = HAND_ROTATIONS[:-2]
