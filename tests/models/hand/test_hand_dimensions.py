"""Dimensions: measured where measured, scaled where not, refused where no hand is like that."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import ASSUMED_LENGTH_MM, DIMENSIONS, HandDimensions


def test_nothing_measured_is_an_assumed_hand_and_says_so() -> None:
    hand = HandDimensions.from_measured({})
    assert hand.is_assumed
    assert hand.hand_length_mm == ASSUMED_LENGTH_MM
    assert set(hand.sizes_mm) == set(DIMENSIONS)


@given(st.floats(60, 300), st.floats(0.6, 1.6))
@settings(max_examples=30)
def test_what_is_measured_stays_and_the_rest_follows_the_length(length: float, wider: float) -> None:
    breadth = 0.45 * length * wider
    hand = HandDimensions.from_measured(
        {"hand_length": length, "hand_breadth": breadth, "I_distal": 0.1 * length}
    )
    assert hand.measured == ("hand_length", "hand_breadth", "I_distal")
    assert not hand.is_assumed
    assert hand.sizes_mm["hand_breadth"] == breadth
    assert hand.sizes_mm["I_distal"] == 0.1 * length
    assert hand.sizes_mm["M_middle"] == pytest.approx(0.170 * length)
    assert hand.knuckle_mm("I") == pytest.approx((0.447 * length, 0.252 * breadth))


def test_a_measured_metacarpal_moves_the_knuckle_along_its_own_line() -> None:
    usual = HandDimensions.from_measured({"hand_length": 190})
    longer = HandDimensions.from_measured({"hand_length": 190, "I_metacarpal": 100})
    x, y = longer.knuckle_mm("I")
    assert (x**2 + y**2) ** 0.5 == pytest.approx(100)
    assert x / y == pytest.approx(usual.knuckle_mm("I")[0] / usual.knuckle_mm("I")[1])


@pytest.mark.parametrize(
    ("measured", "sentence"),
    [
        ({"hand_length": 19}, "hand_length is 19 mm; a hand's length lies between 60 and 300 mm"),
        ({"hand_length": float("nan")}, "hand_length is nan mm"),
        (
            {"hand_length": 190, "I_proximal": 500},
            "I_proximal is 500 mm; with a hand of 190 mm it lies between 25",
        ),
        ({"I_proximal": 50}, "hand_length is missing: measure in mm from the wrist crease"),
        ({"hand_length": 190, "index_length": 72}, "no dimension 'index_length'; did you mean 'hand_length'"),
    ],
)
def test_no_hand_is_like_that(measured: dict[str, float], sentence: str) -> None:
    with pytest.raises(BadInput, match=sentence):
        HandDimensions.from_measured(measured)
