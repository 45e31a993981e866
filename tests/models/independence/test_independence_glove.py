"""The independence examination of a simulated CyberGlove with a reference, and on the wrong hand."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from still_take import still_take

from glovecal_models.independence.answer import Independence, OneWay
from glovecal_models.independence.independence import SIDEWAYS, examine_independence
from glovecal_models.simulation.protocol import segments
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take
from glovecal_models.simulation.simulated_hand import TABLE_1
from glovecal_models.takes.take import Take

EXAMINED = ("TI_ABD", "IM_ABD", "MR_ABD", "RP_ABD", "PALM_ARCH", "W_FLEX", "W_ABD")
INDEPENDENT = {"I_MCP": ("M_MCP", "IM_ABD"), "I_PIP": ("I_MCP", "M_PIP"), "T_TMC": ("TI_ABD",)}


@pytest.fixture(scope="module")
def glove() -> SimulatedGlove:
    return SimulatedGlove(3)


@pytest.fixture(scope="module")
def examined(glove: SimulatedGlove) -> Independence:
    moved = {**{name: tuple(others) for name, others in TABLE_1.items()}, **INDEPENDENT}
    still = [
        still_take(glove, name, others, name=f"still-{name}", seconds=25, with_reference=True)
        for name, others in moved.items()
    ]
    ranges = [
        still_take(glove, None, (name,), name=f"range-{name}", seconds=8, with_reference=True)
        for name in glove.sensors
    ]
    return examine_independence(glove.layout, still, ranges)


def test_it_proposes_the_papers_correspondences(glove: SimulatedGlove, examined: Independence):
    """The built-in layout is the paper's Table 1; the thumb stays read from all its sensors."""
    offered = {item.rotation: item for item in examined.proposals}
    for rotation in (*EXAMINED, *INDEPENDENT):
        now = glove.layout.correspondence(rotation)
        assert offered[rotation].kind == now.kind
        assert set(offered[rotation].sensors) == set(now.sensors), rotation
        assert not offered[rotation].is_change
    assert offered["I_DIP"].kind == "0S1R"
    assert "2/3 * I_PIP" in offered["I_DIP"].sentence
    assert "more accurate with all thumb sensors" in offered["T_TMC"].sentence
    assert OneWay("I_MCP", "IM_ABD") in examined.one_way


def test_what_was_kept_still_by_the_hand_alone_is_still(examined: Independence):
    for item in examined.rotations:
        assert item.still is not None
        assert item.still.is_still
        assert item.is_coupled == (item.rotation in EXAMINED)


def mirrored(take: Take, names: tuple[str, ...]) -> Take:
    flip = np.isin(take.sensors, names)
    return dataclasses.replace(take, readings=np.where(flip, 256 - take.readings, take.readings))


def test_the_glove_of_the_other_hand_is_seen_and_how_sure_it_is(glove: SimulatedGlove):
    takes = [simulate_take(glove, segments("protocol", 1), rate_hz=40).take]
    still = [still_take(glove, "IM_ABD", ("I_MCP", "M_MCP"), name="still-IM_ABD", seconds=12)]

    def worn(names: tuple[str, ...]):
        changed = [mirrored(take, names) for take in takes]
        return examine_independence(glove.layout, still, changed).worn_side

    right = worn(())
    assert right.verdict == "as it should be"
    assert right.reversed_sensors == ()
    other = worn(SIDEWAYS)
    assert other.verdict == "other hand"
    assert set(other.reversed_sensors) <= set(SIDEWAYS)
    assert other.p_value is not None
    assert other.p_value < 1e-3
    assert "looks the same" in other.sentence
    assert worn(glove.sensors).verdict == "back to front"
    swapped = worn(("I_PIP",))
    assert swapped.verdict == "as it should be"
    assert swapped.reversed_sensors == ("I_PIP",)
    assert examine_independence(glove.layout, still, []).worn_side.verdict == "not identifiable"
