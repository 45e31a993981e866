"""Is this the glove of the other hand, or is it worn back to front? Told by the signs of its sensors.

A CyberGlove's flexion sensors read more as joints bend, the sensors between fingers read less as they spread
(two laboratories' calibration files). Data of a left hand has abduction and wrist yaw of the other sign
(VRJuggler's driver); a glove on the wrong hand bends the other way everywhere. Only measured angles tell, and
a reference that counts angles the other way looks the same: the sentence says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from glovecal_models.independence.active_range import measured_slope
from glovecal_models.independence.smooth_readings import SmoothTake
from glovecal_models.layout import Layout
from glovecal_models.simulation.typical_glove import TYPICAL_COUNTS

CLEAR = 5.0
"""A slope of so many standard errors has a sign."""
LEAST_SENSORS = 3
SIDEWAYS = ("IM_ABD", "MR_ABD", "RP_ABD", "W_ABD")
WornVerdict = Literal["as it should be", "other hand", "back to front", "not judgeable"]


@dataclass(frozen=True)
class WornSide:
    verdict: WornVerdict
    probability: float | None
    """That signs drawn by lot agree so well with the verdict; None where it is not judgeable."""
    reversed_sensors: tuple[str, ...]
    sentence: str


def worn_side(layout: Layout, takes: Sequence[SmoothTake]) -> WornSide:
    """Needs takes with measured angles of a CyberGlove."""
    if layout.counts is None or not set(layout.sensors) <= set(TYPICAL_COUNTS):
        return _unknown("only of a CyberGlove it is known which way each sensor reads")
    signs = {name: sign for name in layout.sensors if (sign := _sign(name, takes, layout)) is not None}
    bends = {name: sign for name, sign in signs.items() if name not in SIDEWAYS}
    sideways = {name: sign for name, sign in signs.items() if name in SIDEWAYS}
    turned = tuple(name for name, sign in signs.items() if sign < 0)
    if len(bends) < LEAST_SENSORS or len(sideways) < LEAST_SENSORS:
        return _unknown(
            f"it takes measured angles of {LEAST_SENSORS} bending and {LEAST_SENSORS} sideways joints that "
            "moved"
        )
    wrong_bends, wrong_sideways = (sum(sign < 0 for sign in part.values()) for part in (bends, sideways))
    chance = 0.5 ** len(signs)
    count = f"{wrong_bends} of {len(bends)} bending and {wrong_sideways} of {len(sideways)} sideways sensors"
    sure = f"By lot signs agree so well once in {1 / chance:.0f} times"
    other = "a reference that counts angles the other way looks the same"
    if wrong_bends * 4 >= 3 * len(bends):
        sentence = (
            f"Is this a left glove on a right hand (or the reverse), or worn back to front? {count} read the "
            f"wrong way. {sure}; {other}."
        )
        return WornSide("back to front", chance, turned, sentence)
    if wrong_sideways * 4 >= 3 * len(sideways) and wrong_bends * 4 <= len(bends):
        sentence = f"Is this the glove of the other hand? {count} read the wrong way. {sure}; {other}."
        return WornSide("other hand", chance, turned, sentence)
    odd = f" {', '.join(turned)} read the wrong way: are they swapped with others?" if turned else ""
    return WornSide(
        "as it should be", chance, turned, f"The glove is of this hand: {count} read the wrong way.{odd}"
    )


def _sign(sensor: str, takes: Sequence[SmoothTake], layout: Layout) -> int | None:
    """+1 when the sensor reads the way a CyberGlove's does, -1 when the other way, None when unclear."""
    best = 0.0
    for item in takes:
        found = measured_slope(item, sensor, layout) if sensor in item.take.sensors else None
        if found is not None and found[1] > 0 and abs(found[0] / found[1]) > abs(best):
            best = found[0] / found[1]
    if abs(best) < CLEAR:
        return None
    return 1 if (best > 0) == (TYPICAL_COUNTS[sensor][1] > 0) else -1


def _unknown(why: str) -> WornSide:
    return WornSide("not judgeable", None, (), f"Which hand the glove is of cannot be judged: {why}.")
