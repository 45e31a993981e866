"""Two fingers walk: steps are counted right, planted feet do not slip, over a real stream of poses."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hands_over_zenoh import hands_over_zenoh
from hypothesis import given
from hypothesis import strategies as st
from walking.figure import SHIN_MM, THIGH_MM, Figure, Leg, two_link_leg
from walking.picture import strip
from walking.walking_fingers import lasts_s, walking_fingers

SLIP_MM = 0.01


def walked(steps: int, **settings) -> tuple[Figure, list[tuple[Leg, Leg]]]:
    figure, moments = Figure(), []
    for hand in hands_over_zenoh(walking_fingers(steps), lasts_s(steps), **settings):
        legs = figure.follow(hand)
        if not figure.standing:
            moments.append(legs)
    return figure, moments


def slip_mm(moments: list[tuple[Leg, Leg]]) -> float:
    """The most that a planted foot, as drawn, moves from one moment to the next."""
    moved = [0.0]
    for before, after in pairwise(moments):
        pairs = zip(before, after, strict=True)
        moved += [
            float(np.linalg.norm(now.foot_mm - then.foot_mm))
            for then, now in pairs
            if then.planted and now.planted
        ]
    return max(moved)


@pytest.mark.parametrize(("steps", "sd_deg"), [(0, 2.0), (1, 0.0), (5, 2.0)])
def test_steps_are_counted_and_planted_feet_stay(steps: int, sd_deg: float) -> None:
    figure, moments = walked(steps, sd_deg=sd_deg, seed=3)
    assert figure.steps == steps
    assert slip_mm(moments) < SLIP_MM
    lengths = [np.linalg.norm(leg.foot_mm - leg.knee_mm) for legs in moments for leg in legs]
    np.testing.assert_allclose(lengths, SHIN_MM, atol=1e-6)
    assert min(leg.foot_mm[1] for legs in moments for leg in legs) > -1e-6
    assert any(leg.planted for leg in moments[-1])


def test_every_step_carries_the_body_forward() -> None:
    near, far = (walked(steps, sd_deg=0.0)[0].hip_mm[0] for steps in (2, 4))
    assert near > 300
    assert far > 1.8 * near


def test_a_glove_that_measures_only_knuckles_and_middle_joints_walks_too() -> None:
    only = ("I_MCP", "I_PIP", "M_MCP", "M_PIP")
    figure, moments = walked(4, sd_deg=1.0, rotations=only)
    assert figure.steps == 4
    assert "4 steps" in strip(moments[::30], "4 steps").svg()


@given(st.floats(-1000, 1000), st.floats(-1000, -1))
def test_a_legs_two_links_keep_their_lengths(forward: float, up: float) -> None:
    hip = np.zeros(2)
    target = np.array([forward, up])
    knee, foot = two_link_leg(hip, target)
    assert np.linalg.norm(knee) == pytest.approx(THIGH_MM)
    assert np.linalg.norm(foot - knee) == pytest.approx(SHIN_MM)
    if np.linalg.norm(target) <= THIGH_MM + SHIN_MM:
        np.testing.assert_allclose(foot, target, atol=1e-6)
    assert knee[0] * -foot[1] + knee[1] * foot[0] >= -1e-6  # in front of the line from hip to foot
