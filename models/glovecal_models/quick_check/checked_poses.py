"""Poses compared with the prior and each other: those that contradict are excluded, with the reason."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.quick_check.pose_book import PoseBook
from glovecal_models.quick_check.pose_errors import ObservedPose
from glovecal_models.quick_check.wearing_shift import PoseError, WearingShift

CONTRADICTS = 16.0
"""Mean squared surprise of a pose's rotations, given the others, above which something is wrong with it."""
TURNED_SHARE = 0.25
"""With more of the judged rotations moving the wrong way, the glove is of another hand."""
LEAST_SWING_DEG = 20.0


@dataclass(frozen=True)
class CheckedPose:
    """A pose that was used."""

    label: str
    seconds: float
    measured: int
    """Rotations whose angle was measured."""
    by_name: int
    """Rotations whose angle is known by the pose's name."""
    saturated: tuple[str, ...]
    before_deg: float
    """RMS error of the pose with the model as it was."""
    held_out_deg: float | None
    """RMS error with the shift learned from the other poses; None: there are no others."""
    witness: PoseError


@dataclass(frozen=True)
class RefusedPose:
    """A pose that was not used."""

    label: str
    reason: str


def checked_poses(
    poses: Sequence[ObservedPose], prior: WearingShift, rotations: Sequence[str], known: PoseBook
) -> tuple[tuple[CheckedPose, ...], tuple[RefusedPose, ...]]:
    """The poses to learn from, and those left out. Raises BadInput when too few are left to believe."""
    unknown = [item for item in poses if not item.witness.known.any()]
    refused = [RefusedPose(item.pose.label, _why_unknown(item)) for item in unknown]
    left = [item for item in poses if item.witness.known.any()]
    if not left:
        reasons = "; ".join(f"{item.label}: {item.reason}" for item in refused[:3])
        raise BadInput(
            f"no angle is known in any of the poses ({reasons}); measure r.ROTATION columns, or hold poses "
            f"that have a name: {', '.join(known)}"
        )
    judged = len(left)
    contradicting: list[ObservedPose] = []
    while (worst := _worst(left, prior)) is not None:
        left.remove(worst)
        contradicting.append(worst)
    if len(left) < max(1, (judged + 1) // 2):
        raise BadInput(_nothing_fits([*left, *contradicting], contradicting, rotations, known))
    refused += [RefusedPose(item.pose.label, _mistaken(item, rotations, known)) for item in contradicting]
    return tuple(_checked(item, left, prior) for item in left), tuple(refused)


def _worst(poses: Sequence[ObservedPose], prior: WearingShift) -> ObservedPose | None:
    """Among the poses that the others contradict the one least likely by itself; None: all agree."""
    bad = [item for item in poses if _others(item, poses, prior).contradiction(item.witness) > CONTRADICTS]
    return max(bad, key=lambda item: prior.contradiction(item.witness), default=None)


def _others(item: ObservedPose, poses: Sequence[ObservedPose], prior: WearingShift) -> WearingShift:
    return prior.after(other.witness for other in poses if other is not item)


def _checked(item: ObservedPose, poses: Sequence[ObservedPose], prior: WearingShift) -> CheckedPose:
    witness, known = item.witness, np.flatnonzero(item.witness.known)
    others = _others(item, poses, prior)
    left = witness.error[known] - others.rows(known, witness.joint[known]) @ others.mean
    measured = int((item.measured & witness.known).sum())
    return CheckedPose(
        item.pose.label,
        item.pose.seconds,
        measured,
        len(known) - measured,
        item.saturated,
        _rms(witness.error[known]),
        _rms(left) if len(poses) > 1 else None,
        witness,
    )


def _why_unknown(item: ObservedPose) -> str:
    if item.saturated:
        return f"sensors at the end of their range: {', '.join(item.saturated)}"
    if item.pose.name:
        return f"nothing was measured, and the angles of pose {item.pose.name!r} are not known"
    return "nothing was measured, and the pose has no name"


def _mistaken(item: ObservedPose, rotations: Sequence[str], known: PoseBook) -> str:
    error = np.where(item.witness.known, np.abs(item.witness.error), 0.0)
    lane = int(np.argmax(error / np.sqrt(np.where(item.witness.known, item.witness.variance, 1.0))))
    reason = (
        f"contradicts the other poses and what a new wearing may shift: {rotations[lane]} is predicted "
        f"{item.predicted[lane]:.0f} degrees, but should be {item.angle[lane]:.0f}"
    )
    looks = _looks_like(item, rotations, known)
    return f"{reason}; the hand looks like pose {looks}" if looks and looks != item.pose.name else reason


def _looks_like(item: ObservedPose, rotations: Sequence[str], known: PoseBook) -> str | None:
    """The known pose nearest to the predicted angles."""
    distance = {}
    for name, pose in known.items():
        lanes = [lane for lane, rotation in enumerate(rotations) if rotation in pose.angles]
        if lanes:
            angles = np.array([pose.angles[rotations[lane]] for lane in lanes])
            distance[name] = _rms(item.predicted[lanes] - angles)
    return min(distance, key=distance.__getitem__, default=None)


def _nothing_fits(
    poses: Sequence[ObservedPose],
    contradicting: Sequence[ObservedPose],
    rotations: Sequence[str],
    known: PoseBook,
) -> str:
    count = f"{len(contradicting)} of {len(poses)} poses contradict this model or each other"
    turned, judged = _turned(poses, rotations)
    if judged and len(turned) >= max(1, TURNED_SHARE * judged):
        return (
            f"{count}: {', '.join(turned[:4])} {'moves' if len(turned) == 1 else 'move'} the other way than "
            "predicted; is this the glove of the other hand, or another glove?"
        )
    worst = contradicting[0]
    return (
        f"{count} ({worst.pose.label}: {_mistaken(worst, rotations, known)}); were the poses mistaken, "
        "or is this another person or another glove? Nothing was learned"
    )


def _turned(poses: Sequence[ObservedPose], rotations: Sequence[str]) -> tuple[list[str], int]:
    """Rotations whose known angle falls while the predicted one rises, and how many could be judged."""
    angle = np.array([np.where(item.witness.known, item.angle, np.nan) for item in poses])
    predicted = np.array([item.predicted for item in poses])
    turned, judged = [], 0
    for lane, name in enumerate(rotations):
        seen = np.isfinite(angle[:, lane])
        x, y = predicted[seen, lane], angle[seen, lane]
        if seen.sum() < 2 or np.ptp(y) < LEAST_SWING_DEG:
            continue
        judged += 1
        if float((x - x.mean()) @ (y - y.mean())) < 0:
            turned.append(name)
    return turned, judged


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
