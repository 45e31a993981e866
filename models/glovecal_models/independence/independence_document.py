"""An examination as plain data: what REST answers, and what tables and pictures are made of."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from glovecal_models.independence.affecting_shares import LEAST_MAX_PCT, LEAST_STD_PCT, AffectingShare
from glovecal_models.independence.examination import RotationExamination
from glovecal_models.independence.independence import Independence
from glovecal_models.independence.proposal import Proposal, proposals, proposed_layout


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
        "proposals": [_proposal(item) for item in offered],
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


def _proposal(item: Proposal) -> dict[str, Any]:
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
