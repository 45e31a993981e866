"""Declared effects at work: context outside its range, undefined frames, low passes, names in use."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.effects.base.effect import described
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.catalogue import declared_effect, stored_effect
from glovecal_models.effects.declared.expression_effect import ExpressionEffect, ExpressionStream
from glovecal_models.errors import BadInput


def take_of(own: np.ndarray, **context: np.ndarray) -> Signals:
    frames = len(own)
    return Signals(np.arange(frames) / 50, own, {}, context, "w", "first")


@pytest.fixture
def take() -> Signals:
    generator = np.random.default_rng(2)
    own = 40 + np.cumsum(generator.normal(size=(300, 2)), axis=0)
    return take_of(own, strap_n=np.linspace(2, 20, 300))


def columns(effect: ExpressionEffect, trained: Signals, served: Signals | None = None) -> np.ndarray:
    settings = effect.fit_constants([trained])
    return effect.columns(served or trained, settings, effect.shape.grid([trained], settings)[0])


def test_a_column_is_what_was_written(take):
    found = columns(ExpressionEffect.parse("name = strap; columns = c.strap_n * own_deg, t"), take)
    strap = take.context["strap_n"]
    np.testing.assert_allclose(found[:, :, 0], strap[:, None] * take.own)
    np.testing.assert_allclose(found[:, 1, 1], take.time_s - take.time_s[0])
    own = columns(ExpressionEffect.parse("name = curve; columns = own"), take)[:, :, 0]
    np.testing.assert_allclose([own.mean(), own.std(axis=0)[0]], [0, 1], atol=1e-9)


def test_context_is_held_in_its_range_and_the_unknown_is_usual(take):
    served = replace(take, context={"strap_n": np.where(np.arange(300) < 150, 99.0, np.nan)})
    found = columns(ExpressionEffect.parse("name = strap; columns = c.strap_n"), take, served)[:, 0, 0]
    assert (found[:150] == 20.0).all()
    assert (found[150:] == np.median(take.context["strap_n"])).all()
    declared = ExpressionEffect.parse("name = strap; columns = c.strap_n; range c.strap_n 0 12")
    assert columns(declared, take, served)[0, 0, 0] == 12.0
    assert columns(declared, take).max() == 12.0


def test_a_low_pass_answers_a_step_exactly():
    step = take_of(np.where(np.arange(300) < 100, 0.0, 10.0)[:, None])
    effect = ExpressionEffect.parse("name = slow; columns = lowpass(own_deg, tau), previous(own_deg);"
                                    "parameter tau s 0.2 2 = 0.5")  # fmt: skip
    settings = effect.fit_constants([step])
    found = effect.columns(step, settings, np.array([[0.5]]))
    since = (np.arange(300) - 99) / 50
    np.testing.assert_allclose(found[100:, 0, 0], 10 * (1 - np.exp(-since[100:] / 0.5)), atol=1e-12)
    np.testing.assert_array_equal(found[1:, 0, 1], step.own[:-1, 0])


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("1 / (own_deg - 41.5)", "division by zero in '1 / (own_deg - 41.5)'"),
        ("log(own_deg - 41.5)", "log of 0 in 'log(own_deg - 41.5)'"),
        ("sqrt(41 - own_deg)", "sqrt of -0.5 in 'sqrt(41 - own_deg)'"),
        ("exp(own_deg * own_deg)", "exp of 1722.25 is too large in 'exp(own_deg * own_deg)'"),
        ("(41 - own_deg) ^ 0.5", "-0.5 ^ 0.5 has no real value in '(41 - own_deg) ^ 0.5'"),
    ],
)
def test_training_on_undefined_frames_is_refused(text, sentence):
    own = np.full((60, 1), 5.0) if "exp" in text else np.full((60, 1), 50.0 if "41.5" in text else 20.0)
    own[30] = 41.5
    effect = ExpressionEffect.parse(f"name = mine; columns = {text}")
    with pytest.raises(BadInput) as caught:
        effect.fit_constants([take_of(own)])
    expected = f"effect 'mine': {sentence} at frame 30 of take first (0.600 s from its start)"
    assert str(caught.value).startswith(expected)


def test_serving_gives_such_frames_zero_columns_and_a_flag():
    sound = take_of(np.linspace(50, 60, 40)[:, None])
    own = np.linspace(50, 60, 40)[:, None]
    own[20] = 10.0
    served = take_of(own)
    effect = ExpressionEffect.parse(
        "name = mine; columns = log(own_deg - 40), lowpass(sqrt(own_deg - 40), 1)"
    )
    settings, shape = effect.fit_constants([sound]), np.zeros((1, 0))
    batch = effect.columns(served, settings, shape)
    assert not batch[20].any()
    assert np.isfinite(batch).all()
    stream = effect.dynamics.stream(settings, shape)
    assert isinstance(stream, ExpressionStream)
    for frame in range(40):
        part = slice(frame, frame + 1)
        live = stream.columns(Signals(served.time_s[part], served.own[part]))
        np.testing.assert_allclose(live[0], batch[frame], atol=1e-9)
        assert (stream.undefined is not None) == (frame == 20)
    assert stream.undefined is None
    before = effect.columns(sound, settings, shape)
    assert abs(batch[21, 0, 1] - before[21, 0, 1]) < 0.1


def test_names_are_checked_against_what_was_recorded(take):
    with pytest.raises(BadInput, match=r"no context column 'c.grip'; known are own, own_deg, t, c.strap_n"):
        ExpressionEffect.parse("name = grip; columns = c.grip").fit_constants([take])
    effect = ExpressionEffect.parse("name = thumb; columns = THUMB * own")
    assert effect.not_applicable_reason([take]) == "no signal THUMB was recorded (there are none)"


def test_a_taken_name_is_refused_and_a_stored_effect_comes_back(take):
    with pytest.raises(BadInput, match="there is an effect 'creep' already"):
        declared_effect("name = creep; columns = own")
    effect = declared_effect({"name": "strap", "columns": "c.strap_n"})
    settings = effect.fit_constants([take])
    again = stored_effect("strap", settings)
    assert again.about.explanation == effect.about.explanation == "Declared by the user: c.strap_n."
    assert stored_effect("creep", {}).name == "creep"
    with pytest.raises(BadInput, match="no effect 'strap'; there are clock_offset"):
        stored_effect("strap", {})


def test_two_parameters_make_a_grid_with_the_declared_start(take):
    effect = ExpressionEffect.parse(
        "name = two; columns = lowpass(own, tau) ^ 2 * k; parameter tau s 0.1 10 = 2; parameter k 1 -1 1"
    )
    settings = effect.fit_constants([take])
    grid = effect.shape.grid([take], settings)
    assert grid.shape == (36, 2, 2)
    assert 2.0 in grid[:, 0, 0]
    assert 0.0 in grid[:, 0, 1]
    assert effect.dynamics.has_memory
    assert described(effect, settings, grid[0, 0], np.array([3.0])) == {
        "tau_s": 0.1, "k_1": -1.0, "weight_deg[lowpass(own, tau) ^ 2 * k]": 3.0,
    }  # fmt: skip
