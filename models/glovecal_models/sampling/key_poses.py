"""Steps in which the hand holds a pose: FK-independent sampling, and verification.

Wang & Neff 2013, section 5.1.1: flat, spread, fist and overbend, so that each independent sensor sees at
least two angles. Only the fingers' flexion is taken as known by the pose's name; what a user measured in his
own poses replaces it and may name any rotation.
"""

from __future__ import annotations

from collections.abc import Mapping

from glovecal_models.quick_check.pose_book import KEY_POSES_DEG
from glovecal_models.sampling.protocol import Step

KEY_POSES = ("flat", "spread", "fist", "overbend")
HOLD_S = 1.2
CHECK_PART = "quick-check"
PoseAngles = Mapping[str, Mapping[str, float]]

_ASK = {
    "flat": "Lay your hand flat on the table, fingers together.",
    "spread": "Hand flat on the table, fingers spread as far as they go.",
    "fist": "Make a fist.",
    "overbend": "Bend all knuckles as far as they go, fingers straight.",
    "ramp": "Palm on the table, straight fingers down the 45 degree ramp.",
}
_RAMP = {f"{finger}_MCP": 45.0 for finger in "IMRP"} | {f"{finger}_PIP": 0.0 for finger in "IMRP"}
"""Not the paper's: without it a process knows two clusters of angles and nothing between."""
_NEEDS = {"ramp": "the 45 degree ramp"}
_OVERBEND = {f"{finger}_MCP": 88.0 for finger in "IMRP"} | {f"{finger}_PIP": 12.0 for finger in "IMRP"}


def usual_angles() -> dict[str, dict[str, float]]:
    """The fingers' flexion in the key poses of a usual hand, degrees."""
    known = {
        pose: {name: deg for name, deg in angles.items() if name[0] in "IMRP" and not name.endswith("ABD")}
        for pose, angles in KEY_POSES_DEG.items()
    }
    return known | {"overbend": _OVERBEND, "ramp": _RAMP}


def key_pose_steps(rounds: int = 1, angles: PoseAngles | None = None) -> list[Step]:
    """Every pose once a round; ``angles`` by pose go before the usual ones and may add poses."""
    known = usual_angles() | {pose: dict(own) for pose, own in (angles or {}).items()}
    return [
        _held(f"{pose}-{round_}", "fk_independent", pose, known[pose], f"key-poses-{round_}")
        for round_ in range(1, rounds + 1)
        for pose in known
    ]


def verification_steps(when: str) -> list[Step]:
    """Flat and fist, at the ``start`` and the ``end``: what reads otherwise in the end has moved."""
    part = f"verification-{when}"
    return [_held(f"{pose}-{when}", "verification", pose, {}, part) for pose in ("flat", "fist")]


def check_steps(poses: tuple[str, ...]) -> list[Step]:
    """Poses of a new wearing: their angles are those that the subject's own takes know."""
    return [_held(pose, "verification", pose, {}, CHECK_PART) for pose in poses]


def _held(name: str, kind, pose: str, angles: Mapping[str, float], part: str) -> Step:  # kind: step.Kind
    ask = _ASK.get(pose, f"Take the pose {pose}.")
    return Step(
        name, kind, "hold", ask, HOLD_S, part, pose=pose, angles=dict(angles), needs=_NEEDS.get(pose, "")
    )
