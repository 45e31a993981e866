"""Whether two fingertips can touch, and whether they did: an impossible touch is never calibrated on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import FINGERS, HAND_ROTATIONS, WRIST
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.inverse_kinematics.contact import Rod, Touch
from glovecal_models.inverse_kinematics.follow import FollowedHands, follow
from glovecal_models.inverse_kinematics.hand_shape import HandShape
from glovecal_models.inverse_kinematics.predicted_hand import PredictedHand
from glovecal_models.inverse_kinematics.tip_chains import TipChains

TOUCHING_MM = 0.1
"""What may be left between tips that touch."""
MOST_MISFIT = 5.0
"""Standard deviations of the calibration by which a hand may have to bend for its tips to touch. A calibration
that knows its own error needs 1.5 for a true touch (chi with 3 degrees of freedom), and 5 in one frame of 60000.
"""
LEAST_SHARE = 0.5
"""Of the frames in which the tips must have touched for the take to be a touching motion."""
AT_LIMIT_DEG = 0.01


@dataclass(frozen=True)
class TouchVerdict:
    """Of N frames."""

    reached: np.ndarray
    """(N,): within the limits the tips get together."""
    believable: np.ndarray
    """(N,): and that near to what was predicted."""
    apart_mm: np.ndarray
    """(N,): how far the tips were predicted from where the contact wants them."""
    misfit: np.ndarray
    """(N,): standard deviations of the calibration between the predicted hand and the touching one."""


def require_possible(chains: TipChains, contact: Touch | Rod, skeleton: Skeleton) -> None:
    """Raise BadInput, with what is left and the joints at their limits, where no hand of this size can."""
    found = follow(chains, contact, HandShape.at_rest(chains.rotations))
    if found.missing_mm[0] <= TOUCHING_MM:
        return
    sizes = skeleton.dimensions
    whose = "which nobody measured" if sizes.is_assumed else f"measured: {', '.join(sizes.measured)}"
    raise BadInput(
        f"{_what(contact)} is impossible for this hand: at best {found.missing_mm[0]:.1f} mm are missing, "
        f"with {_at_limits(chains, found.angles_deg[0])}. Check the hand's dimensions (hand length "
        f"{sizes.hand_length_mm:.0f} mm; {whose})"
    )


def judged(chains: TipChains, contact: Touch | Rod, shape: HandShape, found: FollowedHands) -> TouchVerdict:
    reached = found.missing_mm <= TOUCHING_MM
    tips, misfit = chains.tips_mm(shape.centre_deg), shape.misfit(found.angles_deg)
    apart = np.array([np.linalg.norm(contact.missing(each, frame)[0]) for frame, each in enumerate(tips)])
    return TouchVerdict(reached, reached & (misfit <= MOST_MISFIT), apart, misfit)


def require_happened(
    verdict: TouchVerdict,
    chains: TipChains,
    contact: Touch | Rod,
    found: FollowedHands,
    hand: PredictedHand,
    skeleton: Skeleton,
) -> None:
    """Raise BadInput where the tips cannot have touched in most frames, as the calibration reads them."""
    share = float(verdict.believable.mean())
    if share >= LEAST_SHARE:
        return
    said = (
        f"{_what(contact)} cannot be seen in this take: only {100 * share:.0f} % of its "
        f"{len(verdict.reached)} frames fit it (at least {100 * LEAST_SHARE:.0f} % must). The tips are read "
        f"{np.median(verdict.apart_mm):.0f} mm off (median), {np.median(verdict.misfit):.1f} times what the "
        f"calibration may be wrong by (at most {MOST_MISFIT:g})"
    )
    unreached = np.flatnonzero(~verdict.reached)
    if len(unreached):
        worst = unreached[np.argmax(found.missing_mm[unreached])]
        said += (
            f"; in frame {worst} {found.missing_mm[worst]:.1f} mm stay missing with "
            f"{_at_limits(chains, found.angles_deg[worst])}"
        )
    raise BadInput(f"{said}. {_advice(contact, verdict, hand, skeleton)}")


def _advice(contact: Touch | Rod, verdict: TouchVerdict, hand: PredictedHand, skeleton: Skeleton) -> str:
    """What else may have happened."""
    first, second = contact.fingers
    nearest = _nearest(first, hand, skeleton)
    if isinstance(contact, Touch) and nearest[0] != second and nearest[1] < np.median(verdict.apart_mm) / 2:
        return (
            f"The tip nearest to the {FINGERS[first]} is the {FINGERS[nearest[0]]}'s ({nearest[1]:.0f} mm): "
            "was that the finger?"
        )
    return "Repeat the motion with the tips together, or calibrate with key poses first"


def _nearest(finger: str, hand: PredictedHand, skeleton: Skeleton) -> tuple[str, float]:
    """The fingertip that is predicted nearest to that of ``finger``, and the median distance in mm."""
    straight = hand.mean_deg.copy()
    straight[:, [HAND_ROTATIONS.index(name) for name in WRIST]] = 0.0
    tips = forward_kinematics(skeleton, straight).tips_mm
    own = list(FINGERS).index(finger)
    distances = np.median(np.linalg.norm(tips - tips[:, own, None], axis=2), axis=0)
    distances[own] = np.inf
    return list(FINGERS)[int(distances.argmin())], float(distances.min())


def _what(contact: Touch | Rod) -> str:
    first, second = (FINGERS[finger] for finger in contact.fingers)
    if isinstance(contact, Rod):
        return f"a rod of {contact.length_mm:g} mm between {first} and {second}"
    return f"a touch of {first} and {second}"


def _at_limits(chains: TipChains, angles_deg: np.ndarray) -> str:
    limits = chains.limits_deg
    named = [
        f"{name} at its limit of {limits[column, side]:g} degrees"
        for column, name in enumerate(chains.rotations)
        for side in (0, 1)
        if abs(angles_deg[column] - limits[column, side]) < AT_LIMIT_DEG
    ]
    return ", ".join(named) or "no joint at its limit"
