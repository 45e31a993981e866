"""A whole glove examined: each rotation that was kept still in a take, and what is odd about the glove."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from glovecal_models.independence.active_range import ActiveRange, active_ranges
from glovecal_models.independence.affecting_shares import AffectingShare
from glovecal_models.independence.examination import RotationExamination, examine_rotation
from glovecal_models.independence.smooth_readings import SmoothTake, smooth_take
from glovecal_models.independence.still_frames import KnownPulls
from glovecal_models.independence.still_rotation import own_sensor, still_rotations
from glovecal_models.independence.worn_side import WornSide, worn_side
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

PASSES = 3
"""The first finds the pulls on sensors that others pull on, the next ones take them off."""


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
    not_told: tuple[str, ...]
    """Sentences on rotations that could not be examined."""

    def of(self, rotation: str) -> RotationExamination | None:
        return next((item for item in self.rotations if item.rotation == rotation), None)

    @property
    def one_way(self) -> tuple[tuple[str, str], ...]:
        """(affecting, affected) sensors that were examined both ways, of which only one affects the other."""
        pairs = []
        for item in self.rotations:
            for share in item.taken_apart.shares:
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
    examined: list[RotationExamination | str] = []
    for _ in range(PASSES):
        known = _known(layout, [item for item in examined if isinstance(item, RotationExamination)])
        examined = []
        for rotation in layout.rotations:
            held = [item for item in smooth if rotation in still[item.take.name]]
            sensor = own_sensor(layout, rotation)
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
        tuple(item for item in examined if isinstance(item, str)),
    )


def _known(layout: Layout, examined: Sequence[RotationExamination]) -> KnownPulls:
    """Besides what was examined the layout tells: a sensor of a movement of several rotations (the palm's)
    follows others."""
    several = [item.rotation for item in layout.correspondences if item.kind == "MSMR"]
    pulled = frozenset(
        [item.sensor for item in examined if item.is_coupled]
        + [name for rotation in several if (name := own_sensor(layout, rotation)) is not None]
    )
    return KnownPulls(
        pulled,
        {
            item.sensor: item.taken_apart
            for item in examined
            if item.is_coupled and not pulled.intersection(item.taken_apart.curves)
        },
    )


def _held(layout: Layout, rotations: Sequence[str]) -> set[str | None]:
    return {own_sensor(layout, rotation) for rotation in rotations}


def _moves(sensor: str, takes: Sequence[SmoothTake]) -> bool:
    holding = [item for item in takes if sensor in item.take.sensors]
    return not holding or any(item.has_moved(sensor) for item in holding)


def _could_affect(item: RotationExamination, sensor: str) -> bool:
    """Whether it does, or was not moved enough to tell."""
    share: AffectingShare | None = next(
        (one for one in item.taken_apart.shares if one.sensor == sensor), None
    )
    return sensor in item.not_moved or (share is not None and share.affects is not False)
