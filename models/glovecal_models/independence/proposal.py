"""What an examination proposes (how each rotation should be read), and all of it as plain data.

The user confirms, the layout keeps it. The document is what REST answers, and what tables and pictures are
made of.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from glovecal_models.errors import BadInput
from glovecal_models.independence.affecting_shares import LEAST_MAX_PCT, LEAST_STD_PCT, AffectingShare
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
    """None: not examined, it stays as it is. False: an affecting sensor is in doubt."""
    sentence: str

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
        sentence = f"{rotation} has no sensor of its own: it stays {now.simulated} (0S1R)."
        return Proposal(rotation, now.kind, now.sensors, now.kind, now.sensors, None, sentence)
    if found is None or found.is_dead:
        why = "its sensor does not move" if found is not None else "it was not examined"
        sentence = f"{rotation} stays as it is, read from {', '.join(now.sensors)} ({now.kind}): {why}."
        return Proposal(rotation, now.kind, now.sensors, now.kind, now.sensors, None, sentence)
    affecting = [share for share in found.taken_apart.shares if share.affects is not False]
    weak = found.is_coupled and not affecting
    if weak:  # each below the rule, all of them above it
        affecting = list(found.taken_apart.shares)
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
    sentence = _sentence(found, affecting, sensors, kind, thumb if rotation in THUMB else ())
    return Proposal(rotation, kind, sensors, now.kind, now.sensors, not (unsure or weak), sentence)


def _moved_when_still(found: RotationExamination) -> bool:
    return found.stillness is not None and not found.stillness.is_still


def _sentence(
    found: RotationExamination,
    affecting: Sequence[AffectingShare],
    sensors: Sequence[str],
    kind: str,
    thumb: Sequence[str],
) -> str:
    size = f"{found.std_pct:.1f} % of its range (at most {found.max_pct:.1f} %)"
    read = f"read it from {_listed(sensors)} ({kind})"
    if not affecting and found.is_coupled:
        none = f"while {found.rotation} is still, and no sensor explains it"
        return f"{found.sensor} moves by {size} {none}: {read}."
    if not affecting:
        rule = f"below {LEAST_STD_PCT:g} % and {LEAST_MAX_PCT:g} %"
        beside = " Thumb rotations are more accurate with all thumb sensors." if thumb else ""
        return f"{found.sensor} stays within {size} while others move, {rule}: {read}.{beside}"
    by = _listed(
        [f"{share.sensor} ({share.std_pct:.1f} %, at most {share.max_pct:.1f} %)" for share in affecting]
    )
    doubt = [share.sensor for share in affecting if share.affects is None]
    unsure = f" {_listed(doubt)} may be below the rule or stand for another." if doubt else ""
    return f"{found.sensor} is stretched by {by}, in all {size}: {read}.{unsure}"


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def independence_document(found: Independence, layout_name: str) -> dict[str, Any]:
    """The proposed layout gets ``layout_name``. Per cents are of the still sensor's active range."""
    offered = proposals(found)
    return {
        "layout": found.layout.name,
        "rule": {"std_pct": LEAST_STD_PCT, "max_pct": LEAST_MAX_PCT},
        "sensors": list(found.layout.sensors),
        "still": {take: list(rotations) for take, rotations in found.still.items()},
        "rotations": [_rotation(item) for item in found.rotations],
        "one_way": [
            {"affecting": first, "affected": second, "sentence": _one_way(first, second)}
            for first, second in found.one_way
        ],
        "dead_sensors": list(found.dead_sensors),
        "worn_side": asdict(found.worn_side),
        "proposals": [_proposal_document(item) for item in offered],
        "proposed_layout": proposed_layout(found.layout, offered, layout_name).to_document(),
        "sentences": _sentences(found),
    }


def _rotation(item: RotationExamination) -> dict[str, Any]:
    known, still = item.active_range, item.stillness
    return {
        "rotation": item.rotation,
        "sensor": item.sensor,
        "takes": list(item.takes),
        "seconds": item.seconds,
        "std_pct": item.std_pct,
        "max_pct": item.max_pct,
        "is_coupled": item.is_coupled,
        "unexplained_pct": item.taken_apart.unexplained_pct,
        "affecting": [_share(share) for share in item.taken_apart.shares],
        "not_moved": list(item.not_moved),
        "still": None if still is None else {**asdict(still), "is_still": still.is_still},
        "active_range": {
            "readings": known.readings,
            "source": known.source,
            "angle_deg": known.angle_deg,
        },
        "doubts": list(item.doubts),
    }


def _share(share: AffectingShare) -> dict[str, Any]:
    word = {True: "yes", False: "no", None: "undecided"}[share.affects]
    return {**asdict(share), "affects": word}


def _proposal_document(item: Proposal) -> dict[str, Any]:
    return {**asdict(item), "is_change": item.is_change}


def _one_way(first: str, second: str) -> str:
    return f"{first} affects {second}, {second} does not affect {first}."


def _sentences(found: Independence) -> list[str]:
    """What is odd, each once."""
    side = found.worn_side
    odd_side = [side.sentence] if side.verdict != "not judgeable" and side.reversed_sensors else []
    doubts = [doubt for item in found.rotations for doubt in item.doubts]
    examined = {item.sensor for item in found.rotations}
    dead = [
        f"Sensor {name} does not move in any take: is it broken, or its wire?"
        for name in found.dead_sensors
        if name not in examined
    ]
    return list(dict.fromkeys([*odd_side, *dead, *found.not_told, *doubts]))
