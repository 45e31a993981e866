"""The rotations of the kinematic hand, and what stands in for those that nobody measured.

How far each rotation of a healthy hand goes of its own strength, in degrees.

Flexion, abduction and the thumb's turn across the palm are positive. Finger, thumb and wrist flexion and
the wrist's radial (positive) and ulnar deviation follow the joint motion tables of the American Academy of
Orthopaedic Surgeons ("Joint Motion: Method of Measuring and Recording", 1965): MCP 0 to 90, PIP 0 to 100,
DIP 0 to 90, thumb MCP 0 to 50, thumb IP 0 to 80, thumb abduction 0 to 70, wrist 70 extension to 80 flexion,
20 radial to 30 ulnar deviation. Those without a row there are typical values: the spread between two
fingers (30, the widest widget of Wang & Neff 2013, section 5.1.2), the thumb's turn and its virtual joint,
the palm arch, and the little overextension most people show at the finger knuckles.

Right or left, and what is of a hand.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, get_args

import numpy as np

from glovecal_models.errors import BadInput

ACTIVE_RANGE_DEG: dict[str, tuple[float, float]] = {
    "T_TMC": (0.0, 60.0),
    "TI_ABD": (0.0, 70.0),
    "T_VIR": (0.0, 65.0),
    "T_MCP": (0.0, 50.0),
    "T_IP": (0.0, 80.0),
    "I_MCP": (-10.0, 90.0),
    "I_PIP": (0.0, 100.0),
    "I_DIP": (0.0, 90.0),
    "IM_ABD": (0.0, 30.0),
    "M_MCP": (-10.0, 90.0),
    "M_PIP": (0.0, 100.0),
    "M_DIP": (0.0, 90.0),
    "R_MCP": (-10.0, 90.0),
    "R_PIP": (0.0, 100.0),
    "R_DIP": (0.0, 90.0),
    "MR_ABD": (0.0, 30.0),
    "P_MCP": (-10.0, 90.0),
    "P_PIP": (0.0, 100.0),
    "P_DIP": (0.0, 90.0),
    "RP_ABD": (0.0, 30.0),
    "PALM_ARCH": (0.0, 25.0),
    "W_FLEX": (-70.0, 80.0),
    "W_ABD": (-30.0, 20.0),
}
"""Lowest and highest angle of each rotation."""
FINGERS = {"T": "thumb", "I": "index", "M": "middle", "R": "ring", "P": "pinky"}
PALM = "PALM_ARCH"
"""Turns the little finger's metacarpal (Krnoul et al. 2016, section 3.3.3), where a hand has that joint."""
HAND_ROTATIONS: tuple[str, ...] = tuple(name for name in ACTIVE_RANGE_DEG if name != PALM)
"""The order of angles everywhere in this package. The palm is rigid (Wang & Neff 2013, section 3.2)."""
ARCHING_ROTATIONS: tuple[str, ...] = (*HAND_ROTATIONS, PALM)
"""Those of a hand whose palm arches: the same, and one more in the end."""
WRIST = ("W_ABD", "W_FLEX")
LIMITS_DEG = np.array([ACTIVE_RANGE_DEG[name] for name in HAND_ROTATIONS])
"""Lowest and highest angle, shape (R, 2), degrees."""
FLAT_PALM_DEG = 0.0
"""Where nobody measured the palm it is flat: then the arching hand is the rigid one."""

DIP_SHARE = 2 / 3
"""Of the middle joint's bend that the last joint follows (section 3.3)."""
VIRTUAL_SHARES = {"T_TMC": 0.5, "TI_ABD": 0.5}
"""The thumb turns about its own length as its base moves: a and b of section 3.3, which leaves them open."""
RULES: dict[str, dict[str, float]] = {
    **{f"{finger}_DIP": {f"{finger}_PIP": DIP_SHARE} for finger in "IMRP"},
    "T_VIR": VIRTUAL_SHARES,
}
"""Rotations that follow others where nobody measured them."""

REST_DEG: dict[str, float] = {
    "T_TMC": 20.0, "TI_ABD": 30.0, "T_MCP": 15.0, "T_IP": 20.0,
    "I_MCP": 25.0, "I_PIP": 35.0, "M_MCP": 25.0, "M_PIP": 35.0,
    "R_MCP": 25.0, "R_PIP": 35.0, "P_MCP": 25.0, "P_PIP": 35.0,
    "IM_ABD": 5.0, "MR_ABD": 5.0, "RP_ABD": 5.0, "W_FLEX": 0.0, "W_ABD": 0.0,
}  # fmt: skip
"""A relaxed hand, for all that no rule gives."""
Handedness = Literal["right", "left"]
HANDS: tuple[Handedness, ...] = get_args(Handedness)


def completed(
    rotations: Sequence[str], angles_deg: np.ndarray, wanted: Sequence[str] = HAND_ROTATIONS
) -> np.ndarray:
    """Angles (N, len(wanted)) from those of some ``rotations`` (N, K); NaN counts as not measured.

    ``wanted``: those of the hand, which for an arching palm are ``ARCHING_ROTATIONS``.

    What is missing follows its rule, else rests. Rotations that the hand does not have are left out. Raises
    BadInput when ``angles_deg`` does not have one column a rotation.
    """
    given = np.asarray(angles_deg, dtype=float)
    if given.ndim != 2 or given.shape[1] != len(rotations):
        raise BadInput(f"angles have shape {given.shape}, expected (N, {len(rotations)})")
    found = {name: given[:, column] for column, name in enumerate(rotations)}
    ruled: dict[str, np.ndarray] = {}
    unknown = np.full(len(given), np.nan)
    for name, rest in (REST_DEG | {PALM: FLAT_PALM_DEG}).items():
        angle = found.get(name, unknown)
        ruled[name] = np.where(np.isnan(angle), rest, angle)
    for name, weights in RULES.items():
        angle = found.get(name, unknown)
        rule = sum(weight * ruled[source] for source, weight in weights.items())
        ruled[name] = np.where(np.isnan(angle), rule, angle)
    return np.column_stack([ruled[name] for name in wanted])


class HeldAngles:
    """Angles of a whole hand from poses that come one by one. An angle that cannot be used keeps its last
    usable value; what was never usable follows a rule, or rests."""

    def __init__(self) -> None:
        self._last: dict[str, float] = {}

    def degrees(
        self, wanted: Sequence[str], rotations: Sequence[str], degrees: np.ndarray, usable: np.ndarray
    ) -> list[float]:
        """Of the next pose, in the order of ``wanted``: ``degrees`` (K,) and ``usable`` (K,) bool of
        ``rotations``."""
        given = zip(rotations, degrees.tolist(), usable.tolist(), strict=True)
        self._last |= {name: angle for name, angle, is_usable in given if is_usable}
        try:
            return [self._last[name] for name in wanted]
        except KeyError:
            known = np.array([list(self._last.values())])
            return completed(list(self._last), known, wanted)[0].tolist()


def known_hand(said: Any) -> Handedness | None:
    """The hand that somebody named; None for anything else."""
    return next((hand for hand in HANDS if hand == said), None)


def is_of_hand(said: Any, wanted: Handedness | None) -> bool:
    """Whether a glove, take or model of which ``said`` is known may be of the hand that is ``wanted``: where
    nobody said it, of both. None wants either."""
    return wanted is None or known_hand(said) in (None, wanted)
