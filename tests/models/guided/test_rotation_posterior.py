"""Beliefs and touches against independent implementations and their own laws."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, DotProduct

from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.rotations import HAND_ROTATIONS
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.layout import Layout
from glovecal_models.sampling.guided.labelled_takes import LabelledFrames
from glovecal_models.sampling.guided.rotation_posterior import (
    BOW_LENGTH,
    BOW_SHARE,
    Prior,
    RotationPosterior,
    first_posteriors,
)
from glovecal_models.sampling.guided.touch_posterior import TouchFrames, TouchPosterior
from glovecal_models.sampling.inverse_kinematics.contact import Rod, Touch

LAYOUT = Layout.built_in("cyberglove18")
HAND = hand_skeleton(HandDimensions.from_measured({"hand_length": 182}))
NOTHING = LabelledFrames((), ())
RANGES = dict.fromkeys(LAYOUT.sensors, (50.0, 150.0))


def test_a_belief_is_scikit_learns_process() -> None:
    random = np.random.default_rng(1)
    readings, angles = random.uniform(50, 150, (30, 2)), random.normal(20, 10, 30)
    sd, at = random.uniform(0.5, 3.0, 30), random.uniform(40, 160, (12, 2))

    def bow(x: np.ndarray, z: np.ndarray) -> np.ndarray:
        apart = (x[:, None] - z[None]) / 0.5
        return 4.0**2 * np.exp(-0.5 * (apart**2).sum(axis=2))

    middle, span = np.full(2, 100.0), np.full(2, 100.0)
    prior = Prior(("A", "B"), middle, span, np.zeros(2), 0.0, 30.0, 60.0, bow)
    process = RotationPosterior(prior, readings, angles, sd)
    kernel = ConstantKernel(60.0**2) * DotProduct(30.0 / 60.0) + ConstantKernel(16.0) * RBF(0.5)
    options: dict[str, Any] = {"alpha": sd**2, "optimizer": None}
    peer = GaussianProcessRegressor(kernel, **options).fit((readings - 100) / 100, angles)
    mean, covariance = peer.predict((at - 100) / 100, return_cov=True)
    np.testing.assert_allclose(process.mean(at), mean, atol=1e-6)
    np.testing.assert_allclose(process.covariance(at, at), covariance, atol=1e-6)
    np.testing.assert_allclose(process.variance(at), np.diag(covariance), atol=1e-6)


def touches(count: int = 12) -> list[TouchFrames]:
    """Of one slow motion."""
    random, share = np.random.default_rng(2), np.linspace(-1, 1, count)[:, None]
    readings = 100 + 15 * share * random.uniform(-1, 1, len(LAYOUT.sensors))
    return [TouchFrames(Touch(("T", "I")), readings)]


def test_without_touches_nothing_changes() -> None:
    priors = first_posteriors(LAYOUT, NOTHING, RANGES)
    readings = touches()[0].readings
    posterior = TouchPosterior(priors, LAYOUT.sensors, HAND, ())
    column = [LAYOUT.sensors.index("I_MCP")]
    np.testing.assert_array_equal(
        posterior.angles("I_MCP", readings), priors["I_MCP"].mean(readings[:, column])
    )
    assert posterior.told("I_MCP", readings) == 0.0
    follows = 2 / 3 * posterior.angles("I_PIP", readings)
    np.testing.assert_allclose(posterior.angles("I_DIP", readings), follows, atol=1e-9)


def test_touches_close_and_only_take_uncertainty_away() -> None:
    priors, some = first_posteriors(LAYOUT, NOTHING, RANGES), touches()
    before = TouchPosterior(priors, LAYOUT.sensors, HAND, ())
    after = TouchPosterior(priors, LAYOUT.sensors, HAND, some)
    for touch in some:
        assert np.median(after.apart_mm(touch, HAND)) < 0.5 * np.median(before.apart_mm(touch, HAND))
    for rotation in HAND_ROTATIONS:
        was, now = (each.variance(rotation, some[0].readings) for each in (before, after))
        assert (now <= was + 1e-6).all()
        assert 0.0 <= after.told(rotation, some[0].readings) <= 1.0
    assert after.told("I_MCP", some[0].readings) > 0.2
    assert after.told("M_MCP", some[0].readings) == 0.0  # no touch moved it


def test_one_linear_touch_is_a_conditioned_normal() -> None:
    """Small errors of one frame: the posterior is that of a normal density under a linear condition."""
    priors = first_posteriors(LAYOUT, NOTHING, RANGES)
    touch = TouchFrames(Rod(("T", "I"), 60.0), np.full((1, len(LAYOUT.sensors)), 100.0))
    after = TouchPosterior(priors, LAYOUT.sensors, HAND, [touch])
    before = TouchPosterior(priors, LAYOUT.sensors, HAND, ())
    names = [name for name in HAND_ROTATIONS if after.told(name, touch.readings) > 0]
    moved = np.array(
        [after.angles(name, touch.readings)[0] - before.angles(name, touch.readings)[0] for name in names]
    )
    assert after.apart_mm(touch, HAND)[0] < before.apart_mm(touch, HAND)[0]
    assert np.abs(moved).max() > 0.1
    # One condition takes away one direction of what was unknown, no more.
    assert sum(after.told(name, touch.readings) for name in names) <= 1.5


def test_a_hold_bends_a_line_no_more_than_a_sensor_does() -> None:
    low, high = -10.0, 90.0
    process = first_posteriors(LAYOUT, NOTHING, RANGES)["I_MCP"]
    x = np.array([[0.0], [BOW_LENGTH]])
    assert process.prior.shape(x, x)[0, 0] == pytest.approx((BOW_SHARE * (high - low)) ** 2)
