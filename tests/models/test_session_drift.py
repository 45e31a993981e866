"""Five shapes at both ends of a session: what was put in comes out, the way into a shape does not."""

from __future__ import annotations

import re

import numpy as np
import pytest

from glovecal_models.errors import BadInput
from glovecal_models.takes.session_drift import SHAPES, held, session_drift
from glovecal_models.takes.take import Take
from glovecal_models.takes.text import drift_sentence

SENSORS = ("I_MCP", "I_PIP")


def shape(number: int, drift: float, seed: int) -> Take:
    """Three seconds: the first is on the way into the shape."""
    random = np.random.default_rng(seed)
    time_s = np.arange(180) / 60
    way = np.clip(1 - time_s, 0, 1)[:, None]
    readings = 40.0 * number + np.array([drift, -2 * drift]) + 60 * way + random.normal(0, 1, (180, 2))
    return Take("t", "w", SENSORS, time_s, readings)


def test_the_drift_that_was_put_in_comes_out() -> None:
    start = {name: shape(at, 0.0, at) for at, name in enumerate(SHAPES)}
    end = {name: shape(at, 3.0, 10 + at) for at, name in enumerate(SHAPES)}
    found = session_drift(start, end, None)
    assert found.shapes == tuple(SHAPES)
    np.testing.assert_allclose(found.common_counts, [3.0, -6.0], atol=0.3)
    assert found.rms_deg is None
    assert re.search(r"I_PIP -[56]\.", drift_sentence(found))


def test_the_held_part_counts_not_the_way_into_it() -> None:
    np.testing.assert_allclose(held(shape(2, 0.0, 1)), [80.0, 80.0], atol=0.6)


def test_sequences_without_a_common_shape_are_refused() -> None:
    with pytest.raises(BadInput, match="no shape is in both"):
        session_drift({"flat": shape(1, 0, 1)}, {"fist": shape(1, 0, 1)}, None)


def test_hands_that_never_held_a_shape_have_no_drift() -> None:
    start, end = ({name: moving(seed + at) for at, name in enumerate(SHAPES)} for seed in (100, 200))
    with pytest.raises(BadInput, match=r"no shape was held at both ends.*flat: the hand moved in the first"):
        session_drift(start, end, None)


def test_what_was_not_held_or_is_another_shape_is_left_out() -> None:
    start = {name: shape(at, 0.0, at) for at, name in enumerate(SHAPES)}
    end = {name: shape(at, 3.0, 10 + at) for at, name in enumerate(SHAPES)}
    end["spread"] = moving(7)
    end["o-pinky"] = shape(0, 3.0, 30)
    found = session_drift(start, end, None)
    assert found.shapes == ("flat", "fist", "o-index")
    assert "moved in the last by" in found.left_out["spread"]
    assert found.left_out["o-pinky"] == "at the end the hand looks like flat"
    np.testing.assert_allclose(found.common_counts, [3.0, -6.0], atol=0.4)
    assert "Left out: spread, the hand moved" in drift_sentence(found)


def moving(seed: int) -> Take:
    """Four seconds of a hand that bends and stretches all the time."""
    random = np.random.default_rng(seed)
    time_s = np.arange(240) / 60
    phase = random.uniform(0, 6, 2)
    readings = 80 + 80 * np.sin(3 * time_s[:, None] + phase) + random.normal(0, 1, (240, 2))
    return Take("t", "w", SENSORS, time_s, readings)
