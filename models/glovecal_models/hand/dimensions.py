"""How large a hand is: measured, or scaled from its length.

Segment lengths and joint places as shares of hand length and breadth: Buchholz, Armstrong & Goldstein 1992
("Anthropometric data for describing the kinematics of the human hand", Ergonomics 35, 261-273); the
proximal phalanges of the fingers from the ratios of An et al. 1979 ("Normative model of human hand for
biomechanical analysis", J. Biomechanics 12, 775-788); put together as in Sancho-Bru et al. 2011 ("Towards a
realistic and self-contained biomechanical model of the hand"). With these the middle fingertip is one hand
length from the wrist.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean

ASSUMED_LENGTH_MM = 190.0
"""From the wrist crease to the tip of the middle finger; between the means of women (180) and men (194)."""
BREADTH_SHARE = 0.45
"""Hand breadth at the knuckles over hand length: 79/180 of women, 90/194 of men (Greiner 1991, means)."""
SHORTEST_MM, LONGEST_MM = 60.0, 300.0
"""Hand lengths that are believed."""
SMALLEST, LARGEST = 0.5, 2.0
"""Other dimensions are believed within these multiples of what the hand length gives."""

KNUCKLE_PLACES = {"I": (0.447, 0.252), "M": (0.446, 0.0), "R": (0.409, -0.206), "P": (0.368, -0.402)}
"""Knuckle (MCP): from the wrist in hand lengths, from the middle finger to the thumb in hand breadths."""
THUMB_BASE = (0.073, 0.196)
"""Base of the thumb (TMC), likewise."""
PINKY_BASE = (0.092, -0.235)
"""Base of the little finger's metacarpal (CMC), likewise; ours: its bone is then 0.29 hand lengths long."""
_SEGMENTS = {
    "T_metacarpal": 0.251, "T_proximal": 0.196, "T_distal": 0.158,
    "I_proximal": 0.265, "I_middle": 0.143, "I_distal": 0.097,
    "M_proximal": 0.277, "M_middle": 0.170, "M_distal": 0.108,
    "R_proximal": 0.259, "R_middle": 0.165, "R_distal": 0.107,
    "P_proximal": 0.206, "P_middle": 0.117, "P_distal": 0.093,
}  # fmt: skip
_PALM = {f"{finger}_metacarpal": place for finger, place in KNUCKLE_PLACES.items()}
DIMENSIONS = ("hand_length", "hand_breadth", *_PALM, *_SEGMENTS)
"""Names of all; ``I_metacarpal`` to ``P_metacarpal`` reach from the wrist's centre to the knuckle."""


@dataclass(frozen=True)
class HandDimensions:
    """Every dimension of one hand, in mm. Equal when all are."""

    sizes_mm: Mapping[str, float]
    measured: tuple[str, ...]
    """Those that somebody measured; the others follow from the hand length."""

    @classmethod
    def from_measured(cls, measured_mm: Mapping[str, float]) -> HandDimensions:
        """Complete what was measured; nothing measured gives a hand of ``ASSUMED_LENGTH_MM``.

        Raises BadInput for an unknown name, for a size no hand has, and when other sizes come without the
        hand length.
        """
        _require_believable(measured_mm)
        sizes = _scaled(measured_mm.get("hand_length", ASSUMED_LENGTH_MM), measured_mm.get("hand_breadth"))
        sizes |= {name: float(value) for name, value in measured_mm.items()}
        return cls(sizes, tuple(name for name in DIMENSIONS if name in measured_mm))

    @property
    def hand_length_mm(self) -> float:
        return self.sizes_mm["hand_length"]

    @property
    def is_assumed(self) -> bool:
        """Nobody measured this hand."""
        return not self.measured

    def knuckle_mm(self, finger: str) -> tuple[float, float]:
        """Distal and thumbward place of a knuckle, as far from the wrist as its metacarpal says."""
        distal, thumbward = KNUCKLE_PLACES[finger]
        x, y = distal * self.hand_length_mm, thumbward * self.sizes_mm["hand_breadth"]
        longer = self.sizes_mm[f"{finger}_metacarpal"] / math.hypot(x, y)
        return x * longer, y * longer

    def thumb_base_mm(self) -> tuple[float, float]:
        """Distal and thumbward place of the base of the thumb."""
        return THUMB_BASE[0] * self.hand_length_mm, THUMB_BASE[1] * self.sizes_mm["hand_breadth"]

    def pinky_base_mm(self) -> tuple[float, float]:
        """Distal and thumbward place of the base of the little finger's metacarpal."""
        return PINKY_BASE[0] * self.hand_length_mm, PINKY_BASE[1] * self.sizes_mm["hand_breadth"]


def _scaled(length: float, breadth: float | None) -> dict[str, float]:
    breadth = BREADTH_SHARE * length if breadth is None else breadth
    palm = {name: math.hypot(x * length, y * breadth) for name, (x, y) in _PALM.items()}
    segments = {name: share * length for name, share in _SEGMENTS.items()}
    return {"hand_length": length, "hand_breadth": breadth} | palm | segments


def _require_believable(measured_mm: Mapping[str, float]) -> None:
    unknown = [name for name in measured_mm if name not in DIMENSIONS]
    if unknown:
        raise BadInput(f"a hand has no dimension {unknown[0]!r}; {did_you_mean(unknown[0], DIMENSIONS)}")
    if measured_mm and "hand_length" not in measured_mm:
        raise BadInput(
            "hand_length is missing: measure in mm from the wrist crease to the tip of the middle finger"
        )
    length = measured_mm.get("hand_length", ASSUMED_LENGTH_MM)
    _require_between("hand_length", length, SHORTEST_MM, LONGEST_MM, "a hand's length lies")
    for name, expected in _scaled(length, None).items():
        if name in measured_mm and name != "hand_length":
            low, high, which = (
                SMALLEST * expected,
                LARGEST * expected,
                f"with a hand of {length:g} mm it lies",
            )
            _require_between(name, measured_mm[name], low, high, which)


def _require_between(name: str, value: float, low: float, high: float, which: str) -> None:
    if not low <= value <= high:
        raise BadInput(f"{name} is {value:g} mm; {which} between {low:.0f} and {high:.0f} mm")
