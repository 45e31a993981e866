"""What an examination proposes: how each rotation should be read. The user confirms, the layout keeps it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from glovecal_models.errors import BadInput
from glovecal_models.independence.coupling import AffectingShare
from glovecal_models.independence.examination import RotationExamination
from glovecal_models.independence.independence import Independence
from glovecal_models.layout import Correspondence, CorrespondenceKind, Layout

THUMB = ("T_TMC", "TI_ABD", "T_MCP", "T_IP")
"""Wang & Neff 2013, section 3.3: thumb rotations are more accurate when read from all thumb sensors."""
SEVERAL_ROTATIONS = 5
"""A sensor that so many others affect follows a movement of several rotations, as the palm arch does."""


@dataclass(frozen=True)
class Proposal:
    rotation: str
    kind: CorrespondenceKind
    sensors: tuple[str, ...]
    kind_now: CorrespondenceKind
    sensors_now: tuple[str, ...]
    is_sure: bool | None
    """None: not examined, it stays as it is. False: an affecting sensor is undecided."""
    examination: RotationExamination | None = None
    """None: it was not examined."""
    affecting: tuple[AffectingShare, ...] = ()
    """Sensors that it should be read from because of their crosstalk."""
    thumb: tuple[str, ...] = ()
    """Further thumb sensors that make a thumb rotation more accurate."""
    rule: str | None = None
    """Of a rotation without a sensor of its own."""

    @property
    def is_change(self) -> bool:
        return set(self.sensors) != set(self.sensors_now) or self.kind != self.kind_now


def proposals(found: Independence) -> tuple[Proposal, ...]:
    """One for each rotation, in the layout's order."""
    return tuple(_proposal(item, found.of(item.rotation)) for item in found.layout.correspondences)


def proposed_layout(
    layout: Layout, wanted: Sequence[Proposal], name: str, only: Collection[str] | None = None
) -> Layout:
    """``layout`` with the proposals that are sure, or with those for the rotations in ``only``, as ``name``.

    Raises BadInput for a rotation that was not examined.
    """
    by_rotation = {item.rotation: item for item in wanted}
    for rotation in only or ():
        if rotation not in by_rotation or by_rotation[rotation].is_sure is None:
            raise BadInput(f"there is no proposal for {rotation}: it was not examined")
    document = layout.to_document()
    rotations: dict[str, list[str]] = dict(document["rotations"])
    palm: list[str] = list(document["palm"])
    for item in wanted:
        if item.is_change and (item.rotation in only if only is not None else item.is_sure):
            rotations[item.rotation] = list(item.sensors)
            palm = [one for one in palm if one != item.rotation]
            palm += [item.rotation] if item.kind == "MSMR" else []
    return Layout.from_document(document | {"name": name, "rotations": rotations, "palm": palm})


def _proposal(now: Correspondence, found: RotationExamination | None) -> Proposal:
    rotation = now.rotation
    if now.simulated is not None:
        return Proposal(rotation, now.kind, now.sensors, now.kind, now.sensors, None, rule=str(now.simulated))
    if found is None or found.is_dead:
        return Proposal(rotation, now.kind, now.sensors, now.kind, now.sensors, None, found)
    affecting = [share for share in found.coupling.shares if share.affects is not False]
    weak = found.is_coupled and not affecting
    if weak:  # each below the rule, all of them above it
        affecting = list(found.coupling.shares)
    sensors = (found.sensor, *(share.sensor for share in affecting))
    thumb = tuple(name for name in now.sensors if name in THUMB and name not in sensors)
    if rotation in THUMB and thumb:
        sensors = (*sensors, *thumb)
    kind: CorrespondenceKind = (
        "MSMR"
        if now.kind == "MSMR" or len(affecting) >= SEVERAL_ROTATIONS
        else "MS1R"
        if len(sensors) > 1
        else "1S1R"
    )
    unsure = any(share.affects is None for share in affecting) or _moved_when_still(found)
    return Proposal(
        rotation, kind, sensors, now.kind, now.sensors, not (unsure or weak),
        found, tuple(affecting), thumb if rotation in THUMB else (),
    )  # fmt: skip


def _moved_when_still(found: RotationExamination) -> bool:
    return found.stillness is not None and not found.stillness.is_still
