"""Our touching motions against those of mink, an independent library."""

from __future__ import annotations

import numpy as np
import pytest
from inverse_kinematics_bench import moving_shape
from mink_hand import MinkHand

from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.sampling.inverse_kinematics.contact import TipChains, Touch
from glovecal_models.sampling.inverse_kinematics.follow import STILL_DEG, TIP_TOLERANCE_MM, follow


@pytest.mark.parametrize("finger", list("IMR"))
def test_mink_finds_the_same_hands(finger: str) -> None:
    skeleton, shape = hand_skeleton(), moving_shape(finger)
    chains = TipChains(skeleton, ("T", finger))
    ours = follow(chains, Touch(("T", finger)), shape).angles_deg
    theirs = MinkHand(skeleton, ("T", finger)).follow(shape, TIP_TOLERANCE_MM, STILL_DEG)
    assert np.abs(np.diff(chains.tips_mm(theirs), axis=1)).max() < 0.01
    np.testing.assert_allclose(ours, theirs, atol=0.03)
