"""Laws of clamped damped least squares: limits, fixed points, mirror, reach, and the least change."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import minimize

from glovecal_models.errors import BadInput
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.sampling.inverse_kinematics.contact import Rod, TipChains, TipPlaces, Touch
from glovecal_models.sampling.inverse_kinematics.follow import (
    LONGEST_PULL_MM,
    HandShape,
    clamped_pull,
    follow,
)

RIGHT, LEFT = hand_skeleton(), hand_skeleton(hand="left")
MIRROR = np.array([1.0, -1.0, 1.0])
CHAINS = {finger: TipChains(RIGHT, ("T", finger)) for finger in "IMRP"}
FINGER = st.sampled_from("IMRP")
SEED = st.integers(0, 10**6)


def wild_shape(chains: TipChains, seed: int, frames: int = 1) -> HandShape:
    """Anywhere within the limits, some joints far less sure than others."""
    random = np.random.default_rng(seed)
    low, high = chains.limits_deg.T
    centre = random.uniform(low, high, (frames, len(low)))
    return HandShape(chains.rotations, centre, random.uniform(1.0, 10.0, centre.shape))


def near_shape(finger: str, seed: int) -> HandShape:
    """Within some 15 degrees of a touch: the worst calibration that is believed."""
    chains, wild = CHAINS[finger], wild_shape(CHAINS[finger], seed)
    rest = HandShape.at_rest(chains.rotations)
    touching = follow(chains, Touch(("T", finger)), rest).angles_deg
    return replace(wild, centre_deg=touching + 0.15 * (wild.centre_deg - touching))


def assert_within_limits(chains: TipChains, angles: np.ndarray) -> None:
    assert (angles >= chains.limits_deg[:, 0]).all()
    assert (angles <= chains.limits_deg[:, 1]).all()


@given(arrays(float, (1, 2, 3), elements=st.floats(-1e4, 1e4)), FINGER)
@settings(max_examples=15)
def test_limits_are_kept_whatever_is_asked_for(places: np.ndarray, finger: str) -> None:
    chains = CHAINS[finger]
    found = follow(chains, TipPlaces(("T", finger), places), HandShape.at_rest(chains.rotations))
    assert_within_limits(chains, found.angles_deg)
    assert np.isfinite(found.missing_mm).all()


@given(SEED, FINGER)
@settings(max_examples=60)
def test_the_tips_of_a_reachable_hand_are_reached(seed: int, finger: str) -> None:
    chains = CHAINS[finger]
    tips = chains.tips_mm(wild_shape(chains, seed).centre_deg)
    found = follow(chains, TipPlaces(("T", finger), tips), HandShape.at_rest(chains.rotations))
    assert np.abs(chains.tips_mm(found.angles_deg) - tips).max() < 0.1
    assert_within_limits(chains, found.angles_deg)


@given(SEED, FINGER)
@settings(max_examples=40)
def test_tips_touch_from_anywhere(seed: int, finger: str) -> None:
    chains = CHAINS[finger]
    found = follow(chains, Touch(("T", finger)), wild_shape(chains, seed))
    assert found.missing_mm[0] < 0.1
    assert_within_limits(chains, found.angles_deg)


@given(SEED, FINGER)
@settings(max_examples=40)
def test_the_solution_is_a_fixed_point(seed: int, finger: str) -> None:
    chains, touch, shape = CHAINS[finger], Touch(("T", finger)), near_shape(finger, seed)
    found = follow(chains, touch, shape)
    again = follow(chains, touch, shape, found.angles_deg[0])
    assert again.steps[0] <= 1
    np.testing.assert_allclose(again.angles_deg, found.angles_deg, atol=0.02)


@given(SEED, FINGER)
@settings(max_examples=15)
def test_a_left_hand_does_what_the_right_does(seed: int, finger: str) -> None:
    """Angles of a mirrored hand are the same; its tips are mirrored."""
    right, left = CHAINS[finger], TipChains(LEFT, ("T", finger))
    shape, touch = near_shape(finger, seed), Touch(("T", finger))
    ours, theirs = follow(right, touch, shape), follow(left, touch, shape)
    np.testing.assert_allclose(theirs.angles_deg, ours.angles_deg, atol=1e-6)
    np.testing.assert_allclose(
        left.tips_mm(theirs.angles_deg), right.tips_mm(ours.angles_deg) * MIRROR, atol=1e-6
    )


@pytest.mark.parametrize("finger", list("IMRP"))
def test_no_hand_nearer_to_the_shape_touches(finger: str) -> None:
    """Sequential quadratic programming finds no better one, from the shape or from our solution."""
    chains, touch = CHAINS[finger], Touch(("T", finger))
    rest = follow(chains, touch, HandShape.at_rest(chains.rotations)).angles_deg[0]
    random = np.random.default_rng(7)
    for _ in range(5):
        centre = np.clip(rest + random.normal(0, 8, len(rest)), *chains.limits_deg.T)
        sd = random.uniform(1.5, 8.0, len(rest))
        shape = HandShape(chains.rotations, centre[None], sd[None])
        found = follow(chains, touch, shape)

        def misfit(angles: np.ndarray, centre=centre, sd=sd) -> float:
            return float((((angles - centre) / sd) ** 2).sum())

        def gap(angles: np.ndarray) -> np.ndarray:
            tips = chains.tips_mm(angles[None])[0]
            return tips[0] - tips[1]

        for start in (centre, found.angles_deg[0]):
            peer = minimize(
                misfit, start, bounds=chains.limits_deg, constraints={"type": "eq", "fun": gap}, tol=1e-10
            )
            assert peer.success
            assert np.linalg.norm(gap(peer.x)) < 1e-3
            assert shape.misfit(found.angles_deg)[0] ** 2 <= peer.fun + 1e-3
        np.testing.assert_allclose(found.angles_deg[0], peer.x, atol=0.05)


@pytest.mark.parametrize("length", [5.0, 35.0, 90.0])
def test_a_rod_keeps_the_tips_as_far_apart_as_it_is_long(length: float) -> None:
    for finger, chains in CHAINS.items():
        found = follow(chains, Rod(("T", finger), length), wild_shape(chains, 3, frames=6))
        tips = chains.tips_mm(found.angles_deg)
        np.testing.assert_allclose(np.linalg.norm(tips[:, 0] - tips[:, 1], axis=1), length, atol=0.1)
        assert_within_limits(chains, found.angles_deg)


def test_rods_that_no_fingers_hold_are_refused() -> None:
    with pytest.raises(BadInput, match="a rod of 500 mm; rods are 5 to 200 mm long"):
        Rod(("T", "I"), 500.0)
    with pytest.raises(BadInput, match="nan mm"):
        Rod(("T", "I"), float("nan"))


def test_the_pull_is_clamped_as_equation_3_says() -> None:
    missing = np.array([[3.0, -4.0, 0.0], [0.0, 60.0, 80.0]])
    np.testing.assert_allclose(
        clamped_pull(missing), [[3, -4, 0], [0, 0.6 * LONGEST_PULL_MM, 0.8 * LONGEST_PULL_MM]]
    )


def test_what_does_not_fit_together_is_refused() -> None:
    shape = HandShape.at_rest(CHAINS["I"].rotations)
    with pytest.raises(BadInput, match="given for chains of T, I, which move by T_TMC"):
        follow(CHAINS["I"], Touch(("T", "M")), shape)
    with pytest.raises(BadInput, match="standard deviations above 0 degrees"):
        replace(shape, sd_deg=np.zeros_like(shape.sd_deg))
    with pytest.raises(BadInput, match=r"expected \(N, 2\)"):
        HandShape(("I_MCP", "I_PIP"), np.zeros((3, 4)), np.ones((3, 4)))
