"""Controls: each twin does what its name says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.effects.base.control import control_columns
from glovecal_models.effects.catalogue import stored_correction
from glovecal_models.errors import BadInput


def test_reversed_in_time_is_the_operator_run_backwards(signals):
    creep = stored_correction("creep", {})
    shape = np.tile([1.0, 4.0, 16.0], (3, 1))
    take = signals[0]
    [twin] = control_columns(creep, [take], {}, shape, np.random.default_rng(0))
    turned = replace(take, time_s=-take.time_s[::-1], own=take.own[::-1])
    np.testing.assert_allclose(twin[::-1], creep.columns(turned, {}, shape), atol=1e-9)


def test_rolled_in_time_keeps_the_values_and_moves_them(signals):
    coupling = stored_correction("cross_coupling", {})
    settings, shape = coupling.fit_constants(signals), np.zeros((3, 0))
    for seed in range(5):
        twins = control_columns(coupling, signals, settings, shape, np.random.default_rng(seed))
        for take, twin in zip(signals, twins, strict=True):
            true = coupling.columns(take, settings, shape)
            [shift] = [n for n in range(len(take)) if np.array_equal(np.roll(true, n, axis=0), twin)]
            assert 0.19 < shift / len(take) < 0.81


def test_context_comes_from_another_wearing(signals):
    temperature = stored_correction("temperature", {})
    settings, shape = temperature.fit_constants(signals), np.zeros((3, 0))
    time, own = signals[3].time_s[:500], signals[3].own[:500]
    context = {"temperature_c": signals[3].context["temperature_c"][:500]}
    brief = replace(signals[3], time_s=time, own=own, others={}, context=context)
    takes = [*signals[:3], brief]
    for seed in range(8):
        twins = control_columns(temperature, takes, settings, shape, np.random.default_rng(seed))
        level = [twin[:, 0, 0].mean() for twin in twins]
        true = [temperature.columns(take, settings, shape)[:, 0, 0].mean() for take in takes]
        givers = [int(np.argmin(np.abs(np.array(true) - value))) for value in level]
        assert sorted(givers) == [0, 1, 2, 3]
        assert all(takes[giver].wearing != take.wearing for giver, take in zip(givers, takes, strict=True))
    [alone] = control_columns(temperature, takes[:1], settings, shape, np.random.default_rng(0))
    assert not np.allclose(alone, temperature.columns(takes[0], settings, shape))


def permuted(takes, seed):
    """The wearing each take got."""
    donning = stored_correction("donning_shift", {})
    settings = donning.fit_constants(takes)
    twins = control_columns(donning, takes, settings, np.zeros((3, 0)), np.random.default_rng(seed))
    wearings = settings["wearings"]
    return [wearings[int(np.argmax(twin[0, 0, : len(wearings)]))] for twin in twins]


def test_wearings_are_dealt_within_the_same_motion_and_never_as_they_were(signals):
    for seed in range(20):
        free_a, fast_a, free_b, fast_b = permuted(signals, seed)
        assert {free_a, free_b} == {fast_a, fast_b} == {"a", "b"}
        assert free_a != fast_a


def test_names_that_do_not_tell_the_motion_do_not_hinder(signals):
    takes = [replace(take, take=f"take{number}") for number, take in enumerate(signals)]
    found = {tuple(permuted(takes, seed)) for seed in range(30)}
    assert ("a", "a", "b", "b") not in found
    assert ("b", "b", "a", "a") not in found
    assert len(found) == 4
    different = [
        replace(take, take=word) for word, take in zip(["up", "down", "left", "right"], signals, strict=True)
    ]
    assert sorted(permuted(different, 1)) == ["a", "a", "b", "b"]


def test_wearings_that_have_no_other_permutation_are_refused(signals):
    takes = [replace(take, wearing=str(number)) for number, take in enumerate(signals)]
    with pytest.raises(BadInput, match="have no other permutation; record two takes in a wearing"):
        permuted(takes, 0)


@pytest.mark.parametrize("name", ["cross_coupling", "palm_arch", "donning_shift", "nonlinearity"])
def test_what_does_not_remember_is_the_same_at_some_rows_only(signals, name):
    effect = stored_correction(name, {})
    settings = effect.fit_constants(signals)
    shape = effect.shape.grid(signals, settings)[0]
    rows = [slice(1, len(take), 2) for take in signals]
    assert effect.comparison.control != "time-reversed"
    assert not effect.dynamics.needs_time
    every = control_columns(effect, signals, settings, shape, np.random.default_rng(5))
    some = control_columns(effect, signals, settings, shape, np.random.default_rng(5), rows)
    for whole, part, at in zip(every, some, rows, strict=True):
        np.testing.assert_array_equal(whole[at], part)
    true = effect.dynamics.columns_of_takes(signals, settings, shape)
    thinned = effect.dynamics.columns_of_takes(
        [take.at(at) for take, at in zip(signals, rows, strict=True)], settings, shape
    )
    for whole, part, at in zip(true, thinned, rows, strict=True):
        np.testing.assert_array_equal(whole[at], part)
