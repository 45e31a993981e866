"""Where two tips are likeliest to meet: equation (6) searched as the paper does, slopes by differences.

Of a fingertip's position l Wang & Neff 2013, section 5.2.3, says p'(l) = p(theta_l), theta_l being the
inverse kinematics' solution that reaches l (equations 4 and 5), and searches the d that makes the product
over the fingers greatest (6). In ``follow.py`` theta_l is the likeliest hand that reaches l, so that p' is
well defined, and the search over d needs no search: the likeliest hand whose tips touch anywhere has them at
d. ``joint_probability`` is equation (6) itself, as the proof.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.sampling.inverse_kinematics.contact import TipChains, TipPlaces, Touch
from glovecal_models.sampling.inverse_kinematics.follow import (
    TIP_TOLERANCE_MM,
    FollowedHands,
    HandShape,
    follow,
)

SKELETON = hand_skeleton()
UNREACHED = -1e6


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


def nearly_touching(finger: str, seed: int) -> tuple[TipChains, HandShape]:
    """Tips a centimetre or two apart; 3 degrees for a finger's joint, 6 for the thumb's (section 5.2.3)."""
    chains = TipChains(SKELETON, ("T", finger))
    rest = HandShape.at_rest(chains.rotations)
    touching = follow(chains, Touch(("T", finger)), rest).angles_deg
    centre = touching + np.random.default_rng(seed).normal(0, 6, touching.shape)
    sd = np.array([[6.0 if name.startswith("T") else 3.0 for name in chains.rotations]])
    return chains, HandShape(chains.rotations, np.clip(centre, *chains.limits_deg.T), sd)


@pytest.mark.parametrize("finger", list("IR"))
def test_slopes_of_the_joint_probability_are_those_of_finite_differences(finger: str) -> None:
    chains, shape = nearly_touching(finger, 1)
    (place,), found = touch_positions(chains, shape)
    start, step = found.angles_deg[0], 0.05
    for away in ([0.0, 0.0, 0.0], [2.0, -1.0, 1.5]):
        at = place + away
        _, (slope,) = joint_probability(chains, shape, at[None], start)
        moved = at + step * np.concatenate([np.eye(3), -np.eye(3)])
        log = [joint_probability(chains, shape, each[None], start)[0][0] for each in moved]
        np.testing.assert_allclose(slope, (np.array(log[:3]) - log[3:]) / (2 * step), rtol=0.01, atol=5e-3)


@pytest.mark.parametrize(("finger", "sideways"), [("I", 3.0), ("R", -3.0)])
def test_the_touch_is_where_the_paper_would_find_it(finger: str, sideways: float) -> None:
    """Equation (6) by a search over positions; at its end both tips pull against each other."""
    chains, shape = nearly_touching(finger, 2)
    (place,), found = touch_positions(chains, shape)
    start = found.angles_deg[0]
    log, slope = joint_probability(chains, shape, place[None], start)
    assert log[0] == pytest.approx(log_density(shape, found.angles_deg)[0], abs=1e-3)
    assert np.abs(slope).max() < 2e-3

    def less_likely(at: np.ndarray) -> float:
        return -max(float(joint_probability(chains, shape, at[None], start)[0][0]), UNREACHED)

    begin = place + np.array([3.0, sideways, 2.0])
    searched = minimize(less_likely, begin, method="Nelder-Mead", options={"xatol": 0.01})
    np.testing.assert_allclose(searched.x, place, atol=0.2)
    assert -searched.fun <= log[0] + 1e-3


def test_a_finger_is_independent_of_the_other_once_the_place_is_given() -> None:
    """Equation (6) is a sum over the fingers."""
    chains, shape = nearly_touching("I", 3)
    place = touch_positions(chains, shape)[0]
    alone = []
    for finger in "TI":
        chain = TipChains(SKELETON, (finger,))
        own = [shape.rotations.index(name) for name in chain.rotations]
        part = HandShape(chain.rotations, shape.centre_deg[:, own], shape.sd_deg[:, own])
        alone.append(joint_probability(chain, part, place)[0][0])
    assert joint_probability(chains, shape, place)[0][0] == pytest.approx(sum(alone), abs=1e-3)


def test_out_of_reach_nothing_is_likely() -> None:
    """Far away; or, for the middle finger, which does not spread, beside its plane."""
    for finger, place in (("I", [900.0, 0.0, 0.0]), ("M", [100.0, 3.0, -40.0])):
        chains, shape = nearly_touching(finger, 4)
        log, slope = joint_probability(chains, shape, np.array([place]))
        assert log[0] == -np.inf
        assert np.isnan(slope).all()
