"""A touch that never happened is found out while the person still sits there."""

from __future__ import annotations

from dataclasses import replace

import pytest
from asked_session import asked_session

from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.sampling.catalogue import make_protocol
from glovecal_models.sampling.guided.touch_watch import TouchWatch, require_possible_touches
from glovecal_models.sampling.protocol import Step
from glovecal_models.simulation.simulated_glove import SimulatedGlove


@pytest.fixture(scope="module")
def verdicts() -> dict[str, tuple[str, ...]]:
    """Reasons by step, of somebody who keeps middle and thumb 20 mm apart and is right in all else."""
    glove, skeleton = SimulatedGlove(4), hand_skeleton()

    def does(step: Step) -> Step:
        return replace(step, name="apart", rod_mm=20.0) if step.name == "touch-M" else step

    session = asked_session(
        make_protocol("new_subject", glove.layout),
        glove,
        seed=4,
        rate_hz=30,
        skeleton=skeleton,
        touch_check=TouchWatch(glove.layout, skeleton),
        does=does,
        patience=1,
        at_once_s=0.2,
    )
    return {attempt.step: attempt.reasons for attempt in session.state.attempts if attempt.frames}


def test_true_touches_pass(verdicts) -> None:
    for step in ("touch-I", "touch-R", "touch-P", "rod-I-60"):
        assert verdicts[step] == ()


def test_tips_apart_are_told_with_their_distance(verdicts) -> None:
    (reason,) = verdicts["touch-M"]
    assert reason.startswith("the tips of thumb and middle were ")
    assert reason.endswith(" mm from where they should be: keep them together.")
    assert 14 < float(reason.split(" were ")[1].split(" mm")[0]) < 26


def test_a_touch_that_no_such_hand_can_do_is_refused_at_the_start() -> None:
    protocol = make_protocol("ik_only", SimulatedGlove(4).layout)
    require_possible_touches(protocol, hand_skeleton())
    sizes = {"hand_length": 182, "hand_breadth": 140, "T_metacarpal": 24, "T_proximal": 19, "T_distal": 15}
    with pytest.raises(BadInput, match=r"step touch-.: a touch of thumb and .* is impossible for this hand"):
        require_possible_touches(protocol, hand_skeleton(HandDimensions.from_measured(sizes)))
