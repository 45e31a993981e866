"""The rotations of the kinematic hand, and what stands in for those that nobody measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG

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
