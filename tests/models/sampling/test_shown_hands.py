"""Hands that are drawn for a step: what it names is exact, tips that touch do so, nothing is out of range."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, FINGERS, completed
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.layout import Layout
from glovecal_models.sampling.catalogue import make_protocol
from glovecal_models.sampling.protocol import Step
from glovecal_models.sampling.shown_hands import shown_hands

STEPS = make_protocol("new_subject", Layout.built_in("cyberglove18")).steps
SKELETON = hand_skeleton()


@pytest.mark.parametrize("step", STEPS, ids=lambda step: step.name)
def test_a_step_is_shown_as_it_asks(step: Step) -> None:
    hands = shown_hands(step, SKELETON)
    assert len(hands) == (1 if step.motion == "hold" else 2)
    for hand in hands:
        assert {name: hand[name] for name in step.angles} == dict(step.angles)
        assert all(
            ACTIVE_RANGE_DEG[name][0] <= angle <= ACTIVE_RANGE_DEG[name][1] for name, angle in hand.items()
        )
    if step.motion == "move":
        assert hands[0] != hands[1]


@pytest.mark.parametrize("step", [step for step in STEPS if step.touches], ids=lambda step: step.name)
def test_tips_are_together_or_at_the_ends_of_the_rod(step: Step) -> None:
    for hand in shown_hands(step, SKELETON):
        angles = completed(tuple(hand), np.array([list(hand.values())]))
        tips = forward_kinematics(SKELETON, angles).tips_mm[0]
        first, second = (tips[list(FINGERS).index(digit)] for digit in step.touches)
        assert np.linalg.norm(first - second) == pytest.approx(step.rod_mm or 0.0, abs=0.1)
