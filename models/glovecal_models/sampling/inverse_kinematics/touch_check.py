"""Whether two fingertips can touch, and whether they did: an impossible touch is never calibrated on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import FINGERS
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.sampling.inverse_kinematics.contact import Contact, Rod, TipChains, Touch
from glovecal_models.sampling.inverse_kinematics.follow import (
    TIP_TOLERANCE_MM,
    FollowedHands,
    HandShape,
    PredictedHand,
    follow,
)

TOUCHING_MM = 0.1
"""What may be left between tips that touch."""
MOST_MISFIT = 5.0
"""Standard deviations of the calibration by which a hand may have to bend for its tips to touch. Where the
calibration knows its own error, a true touch needs 1.5 (chi with 3 degrees of freedom), and over 5 in one of
65000 frames."""
LEAST_TOUCHING_SHARE = 0.5
"""Of the frames in which the tips must have touched for the take to be a touching motion."""
SUSPICIOUS_MISFIT = 2.5
"""Of the middle frame: one true touch in ten is as far off, if the calibration knows its error."""
CLEARLY_BETTER = 0.7
"""Share of the misfit that another finger leaves when it was that one."""
COMPARED_FRAMES = 20
AT_LIMIT_DEG = 0.01


class TouchNotSeen(BadInput):
    """The tips were elsewhere. ``brief`` is what to say to the person."""

    def __init__(self, message: str, brief: str) -> None:
        super().__init__(message)
        self.brief = brief


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
    angles, distance = closest_approach(chains, contact)
    if distance <= TOUCHING_MM:
        return
    sizes = skeleton.dimensions
    whose = "which nobody measured" if sizes.is_assumed else f"measured: {', '.join(sizes.measured)}"
    raise BadInput(
        f"{_what(contact)} is impossible for this hand: at best {distance:.1f} mm are missing, "
        f"with {_at_limits(chains, angles)}. Check the hand's dimensions (hand length "
        f"{sizes.hand_length_mm:.0f} mm; {whose})"
    )


def judged(chains: TipChains, contact: Touch | Rod, shape: HandShape, found: FollowedHands) -> TouchVerdict:
    reached = found.missing_mm <= TOUCHING_MM
    tips, misfit = chains.tips_mm(shape.centre_deg), shape.misfit(found.angles_deg)
    apart = np.array([np.linalg.norm(contact.missing(each, frame)[0]) for frame, each in enumerate(tips)])
    return TouchVerdict(reached, reached & (misfit <= MOST_MISFIT), apart, misfit)


def require_happened(
    verdict: TouchVerdict, contact: Touch | Rod, hand: PredictedHand, skeleton: Skeleton
) -> None:
    """Raise TouchNotSeen where the tips cannot have touched in most frames, or another finger's did."""
    share, misfit = float(verdict.believable.mean()), float(np.median(verdict.misfit))
    other = _better_finger(contact, misfit, hand, skeleton) if misfit > SUSPICIOUS_MISFIT else None
    if share >= LEAST_TOUCHING_SHARE and other is None:
        return
    said = (
        f"{_what(contact)} cannot be seen in this take: {100 * share:.0f} % of its {len(verdict.reached)} "
        f"frames fit it (at least {100 * LEAST_TOUCHING_SHARE:.0f} % must). The tips are read "
        f"{np.median(verdict.apart_mm):.0f} mm off (median), {misfit:.1f} times what the calibration may be "
        f"wrong by (at most {MOST_MISFIT:g})"
    )
    brief = f"{_tips(contact)} were {np.median(verdict.apart_mm):.0f} mm from where they should be"
    if other is None:
        raise TouchNotSeen(
            f"{said}. Repeat the motion with the tips together, check the hand's dimensions, or calibrate "
            "better before",
            f"{brief}: keep them {'at the rod' if isinstance(contact, Rod) else 'together'}.",
        )
    finger, needed = other
    raise TouchNotSeen(
        f"{said}. For the {FINGERS[finger]} it is {needed:.1f} times: was that the finger?",
        f"{brief}: was that the {FINGERS[finger]}?",
    )


def _better_finger(
    contact: Touch | Rod, misfit: float, hand: PredictedHand, skeleton: Skeleton
) -> tuple[str, float] | None:
    """Another finger whose touch with the thumb the readings fit clearly better, and how well."""
    if isinstance(contact, Rod) or contact.fingers[0] != "T":
        return None
    some = hand.frames(slice(None, None, max(len(hand.mean_deg) // COMPARED_FRAMES, 1)))
    found = []
    for finger in set(FINGERS) - set(contact.fingers):
        chains = TipChains(skeleton, ("T", finger))
        shape = some.shape(chains)
        angles = follow(chains, Touch(("T", finger)), shape).angles_deg
        found.append((float(np.median(shape.misfit(angles))), finger))
    best, finger = min(found)
    return (finger, best) if best < min(MOST_MISFIT, CLEARLY_BETTER * misfit) else None


def _tips(contact: Touch | Rod) -> str:
    first, second = (FINGERS[finger] for finger in contact.fingers)
    return f"the tips of {first} and {second}"


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


def closest_approach(chains: TipChains, contact: Contact) -> tuple[np.ndarray, float]:
    """Angles (K,) within the limits, and the distance left in mm.

    Where the contact is out of reach the damped steps creep, so that a search for the least distance by
    itself ends them.
    """

    def squared(angles: np.ndarray) -> tuple[float, np.ndarray]:
        tips, slopes = chains.tips_and_slopes(angles[None])
        missing, rows = contact.missing(tips[0], 0)
        slope = (missing.reshape(-1) @ rows.reshape(missing.size, -1)) @ slopes[0].reshape(-1, len(angles))
        return float((missing * missing).sum()), -2 * slope

    found = follow(chains, contact, HandShape.at_rest(chains.rotations))
    angles, distance = found.angles_deg[0], float(found.missing_mm[0])
    if distance <= TIP_TOLERANCE_MM:
        return angles, distance
    from scipy.optimize import minimize  # slow to load, and seldom needed

    best = minimize(squared, angles, jac=True, bounds=chains.limits_deg)
    return best.x, float(np.sqrt(best.fun))
