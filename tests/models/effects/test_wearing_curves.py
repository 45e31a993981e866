"""Curves of wearings add up to zero, keep their layout, and widen the claim in another wearing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.effects.base.effect import CorrectionEffect, described
from glovecal_models.effects.base.facts import Uncertainty
from glovecal_models.effects.base.signals import Settings, Signals
from glovecal_models.effects.base.wearing_effect import (
    CURVES,
    WearingCurves,
    joined_curves,
    with_checked_wearing,
)
from glovecal_models.effects.catalogue import stored_correction
from glovecal_models.errors import BadInput

WEARINGS = ("a", "b", "c")
LANES = 2


def shift() -> CorrectionEffect:
    return stored_correction("donning_shift", {})


def uncertainty(settings: Settings, weights: np.ndarray, wearing: str) -> Uncertainty | None:
    of_wearings = shift().weights(settings).of_wearings
    assert of_wearings is not None
    return of_wearings.uncertainty(weights, wearing)


def take(wearing: str, seed: int = 0, frames: int = 300) -> Signals:
    own = np.random.default_rng(seed).uniform([0.0, -20.0], [90.0, 40.0], (frames, LANES))
    return Signals(np.arange(frames) / 50.0, own, {}, {}, wearing, wearing)


def with_curves() -> tuple[Settings, Settings, np.ndarray]:
    """Settings without and with curves, and weights for these."""
    takes = [take(name, seed) for seed, name in enumerate(WEARINGS)]
    plain = shift().fit_constants(takes)
    curved = shift().further.choices(takes, plain)[0]
    count = len(shift().weights(curved).names)
    return plain, curved, np.random.default_rng(1).normal(0, 1, (LANES, count))


def added(settings: Settings, weights: np.ndarray, wearing: str) -> np.ndarray:
    columns = shift().columns(take(wearing, 7), settings, np.zeros((LANES, 0)))
    return np.einsum("nlc,lc->nl", columns, weights)


def test_without_curves_offset_and_gain_are_all() -> None:
    plain, curved, weights = with_curves()
    own = 2 * len(WEARINGS)
    assert len(shift().weights(plain).names) == own
    np.testing.assert_array_equal(shift().weights(curved).prior_sd[:own], shift().weights(plain).prior_sd)
    without = weights.copy()
    without[:, own:] = 0.0
    for name in (*WEARINGS, "unknown"):
        np.testing.assert_allclose(
            added(curved, without, name), added(plain, weights[:, :own], name), atol=1e-12
        )


def test_what_all_wearings_share_is_not_theirs() -> None:
    _, curved, weights = with_curves()
    weights[:, : 2 * len(WEARINGS)] = 0.0
    total = np.sum([added(curved, weights, name) for name in WEARINGS], axis=0)
    np.testing.assert_allclose(total, 0.0, atol=1e-9)
    np.testing.assert_array_equal(added(curved, weights, "unknown"), 0.0)


def test_one_wearing_has_no_curve() -> None:
    alone = [take("a", 0), take("a", 1)]
    assert not shift().further.choices(alone, shift().fit_constants(alone))


def test_a_checked_wearing_leaves_the_others_as_they_were() -> None:
    _, settings, weights = with_curves()
    before = {name: added(settings, weights, name) for name in WEARINGS}
    offset_and_gain = np.array([[3.0, 0.0], [-2.0, 0.0]])
    for _ in range(2):  # a check of the same wearing replaces the first
        settings, weights = with_checked_wearing(
            settings, weights, "new", offset_and_gain, np.tile(np.eye(2), (LANES, 1, 1))
        )
        assert (
            weights.shape[1]
            == len(shift().weights(settings).names)
            == len(shift().weights(settings).prior_sd)
        )
        np.testing.assert_allclose(added(settings, weights, "new"), np.tile([3.0, -2.0], (300, 1)))
        for name in WEARINGS:
            np.testing.assert_allclose(added(settings, weights, name), before[name], atol=1e-12)


def test_an_unseen_wearing_claims_what_curves_differ_by() -> None:
    plain, curved, weights = with_curves()
    own, count = take("z", 7).own, 2 * len(WEARINGS)
    narrow = uncertainty(plain, weights[:, :count], "z")
    wide = uncertainty(curved, weights, "z")
    larger = weights.copy()
    larger[:, count:] *= 3
    widest = uncertainty(curved, larger, "z")
    assert narrow is not None
    assert wide is not None
    assert widest is not None
    assert np.all(wide(own) > narrow(own))
    assert np.all(widest(own) > wide(own))
    assert uncertainty(curved, weights, "a") is None


def test_a_reader_is_told_the_size_of_each_curve() -> None:
    _, curved, weights = with_curves()
    numbers = described(shift(), curved, np.zeros(0), weights[0])
    assert [name for name in numbers if "curve" in name] == [f"curve_rms_deg[{name}]" for name in WEARINGS]
    assert min(numbers[f"curve_rms_deg[{name}]"] for name in WEARINGS) > 0


def test_curves_of_two_effects_on_different_joints_are_joined_unchanged() -> None:
    _, curved, weights = with_curves()
    curves, mine = WearingCurves.of_settings(curved), weights[:, 2 * len(WEARINGS) :]
    assert curves is not None
    other = replace(curves, wearings=("b", "d", "e"))
    found = joined_curves([(curves, {0: 2}, mine), (other, {1: 0}, mine)], 3)
    assert found is not None
    own = take("z", 7).own
    for name in (*WEARINGS, "d", "e"):
        whole = np.einsum("nlc,lc->nl", found[0].columns(own[:, [1, 0, 0]], name), found[1])
        one = np.einsum("nlc,lc->nl", curves.columns(own, name), mine)
        two = np.einsum("nlc,lc->nl", other.columns(own, name), mine)
        np.testing.assert_allclose(whole, np.column_stack([two[:, 1], 0 * own[:, 0], one[:, 0]]), atol=1e-9)


def test_documents_come_back_and_strange_ones_are_refused() -> None:
    _, curved, _ = with_curves()
    curves = WearingCurves.of_settings(curved)
    assert curves is not None
    assert curves.to_document() == curved[CURVES]
    for wrong in ({}, {"wearings": ["a"], "form": curved[CURVES]["form"]}, {"wearings": ["a", "b"]}):
        with pytest.raises(BadInput):
            WearingCurves.of_settings({CURVES: wrong})
