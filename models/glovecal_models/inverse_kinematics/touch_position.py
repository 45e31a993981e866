"""Where two chains are likeliest to meet (Wang & Neff 2013, section 5.2.3).

Of a fingertip's position l the paper says p'(l) = p(theta_l), theta_l being the inverse kinematics' solution
that reaches l (equations 4 and 5), and searches the d that makes the product over the fingers greatest (6).
Here theta_l is the likeliest hand that reaches l, so that p' is well defined, and the search over d needs no
search: the likeliest hand whose tips touch anywhere has them at d (``follow.py``). ``joint_probability``
is equation (6) itself, for pictures like the paper's Figure 7 and as the proof.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.inverse_kinematics.contact import TipPlaces, Touch
from glovecal_models.inverse_kinematics.follow import TIP_TOLERANCE_MM, FollowedHands, follow
from glovecal_models.inverse_kinematics.hand_shape import HandShape
from glovecal_models.inverse_kinematics.tip_chains import TipChains


def touch_positions(chains: TipChains, shape: HandShape) -> tuple[np.ndarray, FollowedHands]:
    """The likeliest place (N, 3) in mm for the two tips to meet in each frame, and the hands."""
    first, second = chains.fingers
    found = follow(chains, Touch((first, second)), shape)
    return chains.tips_mm(found.angles_deg).mean(axis=1), found


def joint_probability(
    chains: TipChains, shape: HandShape, places_mm: np.ndarray, start_deg: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Log probability (N,) that all tips of ``chains`` are at ``places_mm`` (N, 3), and its gradient (N, 3).

    Logarithm of the density over the joints, 1/mm for the gradient; minus infinity where no hand within the
    limits reaches, the gradient NaN. ``start_deg`` (K,) begins the search of the first frame.
    """
    together = np.repeat(places_mm[:, None], len(chains.fingers), axis=1)
    found = follow(chains, TipPlaces(chains.fingers, together), shape, start_deg)
    reached = found.missing_mm <= TIP_TOLERANCE_MM
    log = log_density(shape, found.angles_deg)
    gradient = -found.force.reshape(together.shape).sum(axis=1)
    return np.where(reached, log, -np.inf), np.where(reached[:, None], gradient, np.nan)


def log_density(shape: HandShape, angles_deg: np.ndarray) -> np.ndarray:
    """Of hands (N, K): the sum of the logarithms of equation (4)'s normal densities, (N,)."""
    return -0.5 * shape.misfit(angles_deg) ** 2 - np.log(np.sqrt(2 * np.pi) * shape.sd_deg).sum(axis=1)
