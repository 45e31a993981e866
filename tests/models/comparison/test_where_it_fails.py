"""Where it fails: a planted cause stands first, with a sentence; what is at its floor is left alone."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.comparison.where_it_fails import (
    partitions,
    permutations,
    wearing_errors,
    where_it_fails,
    worst_stretches,
)


def test_the_neighbour_that_pulls_is_named(take_residuals, together, holds, slow):
    generator = np.random.default_rng(6)
    takes = []
    for number in range(3):
        angle = holds(10)
        other = np.where(np.arange(len(angle)) < 600, 0.0, 20 * slow(generator, len(angle), 1.0))
        error = 0.1 * other + 0.5 * generator.normal(size=len(angle))
        takes.append(take_residuals(angle, error, other, name=f"take{number}"))
    [rotation] = where_it_fails(together(*takes)).rotations
    assert rotation.structure[0].covariate == rotation.dependences[0].covariate == "sensor B"
    assert "It depends on the reading of sensor B" in rotation.sentence
    assert "noise floor 0.5" in rotation.sentence
    assert "time in take" not in {item.covariate for item in rotation.structure}


def test_nothing_is_left_to_gain_at_the_floor_and_a_constant_is_said(take_residuals, together, holds):
    generator = np.random.default_rng(8)
    angle = holds(12)
    noise = generator.normal(size=len(angle))
    at_floor, shifted = (
        where_it_fails(together(take_residuals(angle + noise, shift - noise, angle[::-1]))).rotations[0]
        for shift in (0.0, 4.0)
    )
    assert "at the noise floor" in at_floor.sentence
    assert "mostly a constant +4.0" in shifted.sentence
    assert "no recorded column explains it" in shifted.sentence


def test_a_prediction_that_jitters_is_not_called_a_floor(take_residuals, together, holds):
    angle = holds(12)
    jitter = 2.0 * np.random.default_rng(10).normal(size=len(angle))
    [found] = where_it_fails(together(take_residuals(angle, jitter, angle))).rotations
    assert "the prediction's own jitter of 2.0" in found.sentence
    assert "at the noise floor" not in found.sentence


def test_the_worst_second_is_found_with_take_and_time(take_residuals, together):
    angle = np.zeros(1200)
    error = np.ones(1200)
    error[600:660] = 9.0
    found = together(
        take_residuals(angle, np.ones(1200), angle), take_residuals(angle, error, angle, name="two")
    )
    first, *rest = worst_stretches(found)
    assert (first.take, first.rotation, first.rotation_rmse_deg) == ("two", "A", pytest.approx(9.0))
    assert first.start_s == pytest.approx(10.0)
    assert len(rest) == 4
    assert all(one.end_s - one.start_s > 0.9 for one in rest)
    assert all(other.take != "two" or other.end_s <= 10 or other.start_s >= 10.9 for other in rest)


def test_wearings_are_told_apart_by_dealing_their_takes(take_residuals, together):
    generator = np.random.default_rng(9)
    angle = np.zeros(60)

    def found(shift: float, takes: int, wearings: int):
        return together(
            *(
                take_residuals(angle, angle + shift * w + 0.3 * generator.normal(), angle, f"{w}{t}", f"w{w}")
                for w in range(wearings)
                for t in range(takes)
            )
        )

    shifted = wearing_errors(found(3.0, 4, 3), "A", generator)
    assert shifted is not None
    assert shifted.p_value is not None
    assert shifted.p_value <= 0.01
    assert "changes with the wearing" in shifted.sentence
    same = wearing_errors(found(0.0, 4, 3), "A", generator)
    assert same is not None
    assert same.p_value is not None
    assert same.p_value > 0.05
    few = wearing_errors(found(3.0, 2, 2), "A", generator)
    assert few is not None
    assert few.p_value is None
    assert "too few takes to say" in few.sentence
    assert wearing_errors(found(0.0, 4, 1), "A", generator) is None


@pytest.mark.parametrize(("counts", "ways"), [((2, 2), 3), ((3, 3), 10), ((2, 3), 10), ((2, 2, 2), 15)])
def test_partitions_are_counted_and_each_is_dealt_once(counts, ways):
    owners = np.repeat(np.arange(len(counts)), counts)
    assert partitions(counts) == ways
    dealt = permutations(owners, counts, np.random.default_rng(0))
    assert len(dealt) == ways - 1  # the true one is left out
