"""The two chains of a touch against the whole hand's kinematics."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.errors import BadInput
from glovecal_models.hand.forward_kinematics import forward_kinematics, tip_jacobian
from glovecal_models.hand.rotations import FINGERS, HAND_ROTATIONS, WRIST
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.sampling.inverse_kinematics.contact import TipChains


@pytest.mark.parametrize("hand", ["right", "left"])
@pytest.mark.parametrize("fingers", ["TI", "TM", "TR", "TP", "P", "RP", "TIMRP"])
def test_chains_end_where_the_whole_hand_does(hand, fingers: str) -> None:
    skeleton = hand_skeleton(hand=hand)
    angles = np.random.default_rng(4).uniform(-180, 180, (9, len(HAND_ROTATIONS)))
    angles[:, [HAND_ROTATIONS.index(name) for name in WRIST]] = 0.0
    whole = forward_kinematics(skeleton, angles)
    tips = [list(FINGERS).index(finger) for finger in fingers]
    chains = TipChains(skeleton, fingers)
    found, slopes = chains.tips_and_slopes(angles[:, chains.columns])
    np.testing.assert_allclose(found, whole.tips_mm[:, tips], atol=1e-10)
    np.testing.assert_allclose(chains.tips_mm(angles[:, chains.columns]), found, atol=1e-12)
    expected = tip_jacobian(skeleton, whole)[:, tips]
    np.testing.assert_allclose(slopes, expected[..., chains.columns], atol=1e-12)
    others = [column for column, name in enumerate(HAND_ROTATIONS) if name not in (*chains.rotations, *WRIST)]
    assert np.abs(expected[..., others]).max(initial=0.0) < 1e-12


@pytest.mark.parametrize("fingers", ["", "X", "TT"])
def test_fingers_that_a_hand_does_not_have_are_refused(fingers: str) -> None:
    with pytest.raises(BadInput, match="name each once: T, I, M, R, P"):
        TipChains(hand_skeleton(), fingers)
