"""The simulated hand keeps its tips together, by its own rules, within its limits, without a jerk."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import FINGERS, HAND_ROTATIONS
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.simulation.protocol import within_range
from glovecal_models.simulation.simulated_hand import DRIVEN, ROTATIONS, SimulatedHand
from glovecal_models.simulation.touching import touching_segment


@pytest.mark.parametrize(("finger", "hand"), [("I", "right"), ("M", "left"), ("R", "right"), ("P", "left")])
def test_tips_stay_together(finger: str, hand) -> None:
    person = SimulatedHand(1)
    skeleton = hand_skeleton(HandDimensions.from_measured({"hand_length": 175}), hand)
    segment = touching_segment(person, skeleton, finger, seed=4)
    driven = segment.driven(np.arange(176) / 60)
    np.testing.assert_allclose(within_range(driven), driven, atol=1e-9)
    assert 0.1 < np.abs(np.diff(driven, axis=0)).max() < 2.0
    assert (np.ptp(driven, axis=0) > 5).sum() >= 3
    angles = person.complete(dict(zip(DRIVEN, driven.T, strict=True)))
    columns = [ROTATIONS.index(name) for name in HAND_ROTATIONS]
    tips = forward_kinematics(skeleton, angles[:, columns]).tips_mm
    assert np.linalg.norm(tips[:, 0] - tips[:, list(FINGERS).index(finger)], axis=1).max() < 0.05


def test_the_same_seed_is_the_same_motion_and_the_thumb_touches_fingers_only() -> None:
    person, skeleton, time = SimulatedHand(0), hand_skeleton(), np.arange(20) / 30
    once, again, other = (touching_segment(person, skeleton, "I", seed).driven(time) for seed in (1, 1, 2))
    np.testing.assert_array_equal(once, again)
    assert np.abs(once - other).max() > 1
    with pytest.raises(BadInput, match="the thumb touches I, M, R, P, not 'T'"):
        touching_segment(person, skeleton, "T", 1)
