"""References that contradict each other are told of; a hand in another wearing is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.diagnosis.reference_problems import reference_problems
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

LAYOUT = Layout.from_columns("one", ["I_PIP"], ["I_PIP"])


def take(number: int, wearing: str = "w") -> Take:
    random = np.random.default_rng(number)
    time = np.arange(0, 10, 1 / 30)
    angle = 40 + 30 * np.sin(time * (1 + 0.1 * number)) + 0.3 * random.normal(size=len(time))
    readings = (60 + 1.2 * angle + 0.3 * random.normal(size=len(time)))[:, None]
    return Take(f"t{number}", wearing, ("I_PIP",), time, readings, ("I_PIP",), time.copy(), angle[:, None])


def test_one_take_in_radians_among_others_in_degrees():
    odd = replace(take(2), reference=np.radians(take(2).reference))
    [problem] = reference_problems([take(0), take(1), odd], LAYOUT)
    assert problem.startswith("I_PIP in take t2")
    assert "radians" in problem


def test_two_takes_of_opposite_sign():
    [problem] = reference_problems([take(0), replace(take(1), reference=-take(1).reference)], LAYOUT)
    assert "rises with its sensor in take t0 and falls in take t1" in problem


@pytest.mark.parametrize(("wearing", "is_told"), [("w", True), ("other", False)])
def test_two_takes_whose_angles_differ_where_they_read_the_same(wearing, is_told):
    odd = replace(take(1, wearing), reference=take(1).reference + 25.0)
    problems = reference_problems([take(0), odd], LAYOUT)
    assert bool(problems) == is_told, "another wearing may well shift the readings"
    if problems:
        assert "t0 and t1 contradict each other, by 25 degrees" in problems[0]


def test_a_sensor_that_slips_a_little_is_no_contradiction():
    slipped = replace(take(1), reference=take(1).reference + 6.0)
    assert reference_problems([take(0), slipped], LAYOUT) == ()
