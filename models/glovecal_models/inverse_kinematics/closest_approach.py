"""How near two fingertips can get to what is asked of them, whatever the hand's shape."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from glovecal_models.inverse_kinematics.contact import Contact
from glovecal_models.inverse_kinematics.follow import TIP_TOLERANCE_MM, follow
from glovecal_models.inverse_kinematics.hand_shape import HandShape
from glovecal_models.inverse_kinematics.tip_chains import TipChains


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
    best = minimize(squared, angles, jac=True, bounds=chains.limits_deg)
    return best.x, float(np.sqrt(best.fun))
