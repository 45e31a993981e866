"""Where two tips are likeliest to meet: equation (6) searched as the paper does, slopes by differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.inverse_kinematics.contact import Touch
from glovecal_models.inverse_kinematics.follow import follow
from glovecal_models.inverse_kinematics.hand_shape import HandShape
from glovecal_models.inverse_kinematics.tip_chains import TipChains
from glovecal_models.inverse_kinematics.touch_position import joint_probability, log_density, touch_positions

SKELETON = hand_skeleton()
UNREACHED = -1e6


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
