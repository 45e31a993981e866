"""A whole glove examined: each rotation that was kept still in a take, and what is odd about the glove.

Is it the glove of the other hand, or worn back to front? Its sensors' signs tell. A CyberGlove's flexion
sensors read more as joints bend, the sensors between fingers read less as they spread (two laboratories'
calibration files). Data of a left hand has abduction and wrist yaw of the other sign (VRJuggler's driver); a
glove on the wrong hand bends the other way everywhere. Only measured angles tell, and a reference that counts
angles the other way looks the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from glovecal_models.independence.active_range import ActiveRange, active_ranges, measured_slope
from glovecal_models.independence.coupling import AffectingShare
from glovecal_models.independence.examination import NotExamined, RotationExamination, examine_rotation
from glovecal_models.independence.smooth_readings import SmoothTake, smooth_take
from glovecal_models.independence.still_frames import KnownCrosstalk
from glovecal_models.independence.still_rotation import still_rotations
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take
from glovecal_models.typical_counts import TYPICAL_COUNTS

CLEAR = 5.0
"""A slope of so many standard errors has a sign."""
LEAST_SENSORS = 3
SIDEWAYS = ("IM_ABD", "MR_ABD", "RP_ABD", "W_ABD")
WornVerdict = Literal["as it should be", "other hand", "back to front", "not identifiable"]


@dataclass(frozen=True)
class WornSide:
    verdict: WornVerdict
    p_value: float | None
    """That random signs agree so well with the verdict; None where it is not identifiable."""
    reversed_sensors: tuple[str, ...]
    is_known_glove: bool
    """Whether it is known which way each of its sensors reads: a CyberGlove."""
    bending: str = ""
    """How many bending sensors read the wrong way, as "1 of 9"."""
    sideways: str = ""


def worn_side(layout: Layout, takes: Sequence[SmoothTake]) -> WornSide:
    """Needs takes with measured angles of a CyberGlove."""
    if layout.counts is None or not set(layout.sensors) <= set(TYPICAL_COUNTS):
        return WornSide("not identifiable", None, (), False)
    signs = {name: sign for name in layout.sensors if (sign := _sign(name, takes, layout)) is not None}
    bends = {name: sign for name, sign in signs.items() if name not in SIDEWAYS}
    sideways = {name: sign for name, sign in signs.items() if name in SIDEWAYS}
    turned = tuple(name for name, sign in signs.items() if sign < 0)
    if len(bends) < LEAST_SENSORS or len(sideways) < LEAST_SENSORS:
        return WornSide("not identifiable", None, (), True)
    wrong_bends, wrong_sideways = (sum(sign < 0 for sign in part.values()) for part in (bends, sideways))
    p_value = 0.5 ** len(signs)
    verdict: WornVerdict = "as it should be"
    if wrong_bends * 4 >= 3 * len(bends):
        verdict = "back to front"
    elif wrong_sideways * 4 >= 3 * len(sideways) and wrong_bends * 4 <= len(bends):
        verdict = "other hand"
    bending, across = f"{wrong_bends} of {len(bends)}", f"{wrong_sideways} of {len(sideways)}"
    return WornSide(verdict, p_value, turned, True, bending, across)


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


PASSES = 3
"""The first finds the crosstalk on cross-coupled sensors, the next ones subtract it."""


@dataclass(frozen=True)
class Independence:
    layout: Layout
    rotations: tuple[RotationExamination, ...]
    """In the layout's order."""
    still: Mapping[str, tuple[str, ...]]
    """Take to the rotations that were kept still in it."""
    ranges: Mapping[str, ActiveRange]
    dead_sensors: tuple[str, ...]
    worn_side: WornSide
    not_examined: tuple[NotExamined, ...]

    def of(self, rotation: str) -> RotationExamination | None:
        return next((item for item in self.rotations if item.rotation == rotation), None)

    @property
    def one_way(self) -> tuple[tuple[str, str], ...]:
        """(affecting, affected) sensors that were examined both ways, of which only one affects the other."""
        pairs = []
        for item in self.rotations:
            for share in item.coupling.shares:
                back = next((other for other in self.rotations if other.sensor == share.sensor), None)
                if share.affects and back is not None and not _could_affect(back, item.sensor):
                    pairs.append((share.sensor, item.sensor))
        return tuple(pairs)


def examine_independence(
    layout: Layout,
    takes: Sequence[Take],
    range_takes: Sequence[Take] = (),
    named: Mapping[str, str] | None = None,
) -> Independence:
    """``takes`` have one rotation each kept still; ``named`` says which, by the take's name, where neither
    name nor measured angles tell. In ``range_takes`` joints go through their ranges; the examined takes
    themselves tell the ranges of what moved in them. Raises BadInput for a take that does not tell its
    rotation."""
    smooth = [smooth_take(take) for take in takes]
    still = {
        item.take.name: still_rotations(item, layout, (named or {}).get(item.take.name)) for item in smooth
    }
    for_range = [smooth_take(take) for take in range_takes]
    dead = tuple(name for name in layout.sensors if not _moves(name, [*smooth, *for_range]))
    ranges = {
        name: active_ranges(
            layout,
            [*for_range, *(item for item in smooth if name not in _held(layout, still[item.take.name]))],
        )[name]
        for name in layout.sensors
    }
    examined: list[RotationExamination | NotExamined] = []
    for _ in range(PASSES):
        known = _known(layout, [item for item in examined if isinstance(item, RotationExamination)])
        examined = []
        for rotation in layout.rotations:
            held = [item for item in smooth if rotation in still[item.take.name]]
            sensor = layout.correspondence(rotation).measuring_sensor
            if held and sensor is not None:
                is_dead = sensor in dead
                examined.append(examine_rotation(rotation, sensor, held, ranges, dead=is_dead, known=known))
    side = worn_side(layout, [*smooth, *for_range])
    return Independence(
        layout,
        tuple(item for item in examined if isinstance(item, RotationExamination)),
        still,
        ranges,
        dead,
        side,
        tuple(item for item in examined if isinstance(item, NotExamined)),
    )


def _known(layout: Layout, examined: Sequence[RotationExamination]) -> KnownCrosstalk:
    """From the examination and the layout: a sensor of a movement of several rotations (the palm's) follows
    others."""
    palm = [item.measuring_sensor for item in layout.correspondences if item.kind == "MSMR"]
    coupled = [item.sensor for item in examined if item.is_coupled]
    coupled = frozenset([*coupled, *filter(None, palm)])
    return KnownCrosstalk(
        coupled,
        {
            item.sensor: item.coupling
            for item in examined
            if item.is_coupled and not coupled.intersection(item.coupling.curves)
        },
    )


def _held(layout: Layout, rotations: Sequence[str]) -> set[str | None]:
    return {layout.correspondence(rotation).measuring_sensor for rotation in rotations}


def _moves(sensor: str, takes: Sequence[SmoothTake]) -> bool:
    holding = [item for item in takes if sensor in item.take.sensors]
    return not holding or any(item.has_moved(sensor) for item in holding)


def _could_affect(item: RotationExamination, sensor: str) -> bool:
    """Whether it does, or was not moved enough to tell."""
    share: AffectingShare | None = next((one for one in item.coupling.shares if one.sensor == sensor), None)
    return sensor in item.not_moved or (share is not None and share.affects is not False)
