"""What every effect promises, held against each effect of the catalogue and against declared ones."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, get_args

import numpy as np
import pytest

from glovecal_models.effects.base.control import control_columns
from glovecal_models.effects.base.effect import (
    CorrectionEffect,
    Effect,
    FurtherColumns,
    described,
    unavailable_inputs,
)
from glovecal_models.effects.base.facts import Control
from glovecal_models.effects.base.signals import Settings, Signals
from glovecal_models.effects.catalogue import catalogue, stored_correction
from glovecal_models.effects.declared.expression_effect import ExpressionEffect
from glovecal_models.errors import BadInput

DECLARED = [
    ExpressionEffect.parse(
        "name = strap; unit = deg; columns = c.contact_n * own, c.contact_n; range c.contact_n 0 50"
    ),
    ExpressionEffect.parse(
        "name = glue; columns = lowpass(own_deg, tau) - own_deg, tanh(I_PIP) * own - previous(own);"
        "parameter tau s 0.1 5 = 1; control = time-reversed"
    ),
    ExpressionEffect.parse(
        "name = two-shapes; columns = exp(-t / rate) * abs(own_deg) ^ power;"
        "parameter rate s 5 50; parameter power 1 0.5 2"
    ),
]
EVERY = [*catalogue().values(), *DECLARED]
EFFECTS = [item for item in EVERY if isinstance(item, CorrectionEffect)]
FURTHER = [item for item in EFFECTS if type(item.further).constants is not FurtherColumns.constants]
FIXED_NAMES = [
    "nonlinearity", "cross_coupling", "palm_arch", "hysteresis", "creep", "lag", "clock_offset",
    "glove_latency", "repeated_samples", "warmup_drift", "temperature", "humidity", "donning_shift",
    "garment_slip", "supply_sag", "saturation", "contact_pressure", "sensor_fault",
]  # fmt: skip
UNIT = re.compile(r"_(deg|s|ppm|1)(?=$|[_\[])|_per_")


@pytest.fixture(params=EFFECTS, ids=lambda effect: effect.name)
def effect(request: pytest.FixtureRequest) -> CorrectionEffect:
    return request.param


def correction(name: str) -> CorrectionEffect:
    return stored_correction(name, {})


@pytest.fixture
def settings(effect: CorrectionEffect, signals: list[Signals]) -> Settings:
    """Settings as a stored model holds them."""
    return json.loads(json.dumps(effect.fit_constants(signals)))


def each_frame(take: Signals) -> list[Signals]:
    return [
        replace(
            take,
            time_s=take.time_s[at : at + 1],
            own=take.own[at : at + 1],
            others={name: values[at : at + 1] for name, values in take.others.items()},
            context={name: values[at : at + 1] for name, values in take.context.items()},
        )
        for at in range(len(take))
    ]


def first_frames(take: Signals, count: int) -> Signals:
    return joined(each_frame(take)[:count])


def joined(pieces: Sequence[Signals]) -> Signals:
    first = pieces[0]
    return replace(
        first,
        time_s=np.concatenate([piece.time_s for piece in pieces]),
        own=np.concatenate([piece.own for piece in pieces]),
        others={name: np.concatenate([piece.others[name] for piece in pieces]) for name in first.others},
        context={name: np.concatenate([piece.context[name] for piece in pieces]) for name in first.context},
    )


def one_lane(take: Signals, lane: int) -> Signals:
    return replace(take, own=take.own[:, lane : lane + 1])


def test_the_fixed_names_are_all_there() -> None:
    assert set(FIXED_NAMES) | {"no_effect"} == set(catalogue())


@pytest.mark.parametrize("effect", EVERY, ids=lambda effect: effect.name)
def test_it_says_what_it_is(effect: Effect) -> None:
    assert re.match(r"[a-z][a-z0-9_-]+\Z", effect.name)
    about = effect.about
    assert about.explanation[0].isupper()
    assert about.explanation.endswith(".")
    assert "\n" not in about.explanation
    assert about.source
    assert effect.comparison is None or effect.comparison.control in get_args(Control)
    for parameter in effect.shape.parameters:
        assert parameter.low < parameter.high
        assert parameter.unit
        assert parameter.prior


def test_the_examples_can_be_judged(effect: CorrectionEffect, signals: list[Signals]) -> None:
    assert effect.not_applicable_reason(signals) is None


def test_shapes_are_within_the_declared_ranges(
    effect: CorrectionEffect, signals: list[Signals], settings: Any
) -> None:
    grid = effect.shape.grid(signals, settings)
    assert grid.ndim == 3
    assert len(grid) >= 1
    assert grid.shape[1:] == (signals[0].own.shape[1], len(effect.shape.parameters))
    for column, parameter in enumerate(effect.shape.parameters):
        assert (grid[:, :, column] >= parameter.low - 1e-12).all()
        assert (grid[:, :, column] <= parameter.high + 1e-12).all()


def test_columns_are_finite_repeatable_and_of_the_right_shape(
    effect: CorrectionEffect, signals: list[Signals], settings: Settings
) -> None:
    names = effect.weights(settings).names
    for shape in effect.shape.grid(signals, settings):
        for take in signals:
            columns = effect.columns(take, settings, shape)
            assert columns.shape == (len(take), take.own.shape[1], len(names))
            assert np.isfinite(columns).all()
            assert np.array_equal(columns, effect.columns(take, settings, shape))
            assert not (columns @ np.zeros(len(names))).any()


def test_settings_survive_being_stored(
    effect: CorrectionEffect, signals: list[Signals], settings: Settings
) -> None:
    fresh = effect.fit_constants(signals)
    shape = effect.shape.grid(signals, fresh)[-1]
    expected = effect.columns(signals[0], fresh, shape)
    again = stored_correction(effect.name, settings)
    assert np.array_equal(again.columns(signals[0], settings, shape), expected)
    assert again.weights(settings).names == effect.weights(fresh).names


def test_lanes_do_not_know_each_other(
    effect: CorrectionEffect, signals: list[Signals], settings: Settings
) -> None:
    shape = effect.shape.grid(signals, settings)[-1]
    together = effect.columns(signals[1], settings, shape)
    for lane in range(signals[0].own.shape[1]):
        alone = [one_lane(take, lane) for take in signals]
        own_settings = effect.fit_constants(alone)
        own_shape = effect.shape.grid(alone, own_settings)[-1]
        np.testing.assert_allclose(own_shape, shape[lane : lane + 1], rtol=1e-12)
        found = effect.columns(alone[1], own_settings, own_shape)[:, 0]
        np.testing.assert_allclose(found, together[:, lane], rtol=1e-9, atol=1e-9)


def test_several_shapes_at_once_are_lanes(
    effect: CorrectionEffect, signals: list[Signals], settings: Settings
) -> None:
    take, grid = signals[0], effect.shape.grid(signals, settings)[:3]
    lanes = take.own.shape[1]
    wide = replace(take, own=np.tile(take.own, (1, len(grid))))
    together = effect.columns(wide, settings, np.concatenate(list(grid)))
    for number, shape in enumerate(grid):
        part = together[:, number * lanes : (number + 1) * lanes]
        np.testing.assert_allclose(part, effect.columns(take, settings, shape), rtol=1e-12, atol=1e-12)


def test_settings_of_other_lanes_are_refused(signals: list[Signals]) -> None:
    effect = correction("nonlinearity")
    settings = effect.fit_constants(signals)
    with pytest.raises(BadInput, match="settings of 3 lanes were given signals of 1"):
        effect.columns(one_lane(signals[0], 0), settings, np.zeros((1, 0)))


def with_gaps(take: Signals) -> Signals:
    """Uneven frame times, with a gap of 0.5 s that is bridged and one of 3 s that is not."""
    take = first_frames(take, 400)
    time = take.time_s.copy()
    time[150:] += 0.5
    time[300:] += 3.0
    return replace(take, time_s=time)


def test_all_takes_together_are_each_take(
    effect: CorrectionEffect, signals: list[Signals], settings: Settings
) -> None:
    takes = [*signals, with_gaps(signals[0]), first_frames(signals[1], 1)]
    shape = effect.shape.grid(signals, settings)[-1]
    for take, found in zip(takes, effect.dynamics.columns_of_takes(takes, settings, shape), strict=True):
        assert np.array_equal(found, effect.columns(take, settings, shape))


@pytest.mark.parametrize("repaired", FURTHER, ids=lambda effect: effect.name)
def test_columns_of_a_repair_keep_the_promises_too(
    repaired: CorrectionEffect, signals: list[Signals]
) -> None:
    settings = json.loads(json.dumps(repaired.further.constants(repaired, signals)))
    shape, take = repaired.shape.grid(signals, settings)[-1], with_gaps(signals[0])
    columns = repaired.columns(take, settings, shape)
    names = repaired.weights(settings).names
    assert columns.shape[2] == len(names) == len(repaired.weights(settings).prior_sd) == len(set(names))
    assert set(names) - set(repaired.weights(repaired.fit_constants(signals)).names)
    stream = repaired.dynamics.stream(settings, shape)
    live = np.concatenate([stream.columns(frame) for frame in each_frame(take)])
    np.testing.assert_allclose(live, columns, rtol=0, atol=1e-9)
    together = repaired.dynamics.columns_of_takes([*signals, take], settings, shape)
    assert np.array_equal(together[-1], columns)
    assert np.array_equal(together[0], repaired.columns(signals[0], settings, shape))


def test_frame_by_frame_gives_the_same(
    effect: CorrectionEffect, signals: list[Signals], settings: Settings
) -> None:
    take = with_gaps(signals[0])
    shape = effect.shape.grid(signals, settings)[0]
    stream = effect.dynamics.stream(settings, shape)
    live = np.concatenate([stream.columns(frame) for frame in each_frame(take)])
    np.testing.assert_allclose(live, effect.columns(take, settings, shape), rtol=0, atol=1e-9)
    stream.reset()
    for _ in range(2):  # after a reset, and after the clock was set back
        again = np.concatenate([stream.columns(frame) for frame in each_frame(take)[:50]])
        np.testing.assert_allclose(again, live[:50], rtol=0, atol=1e-12)


def test_later_frames_change_nothing(
    effect: CorrectionEffect, signals: list[Signals], settings: Settings
) -> None:
    take = signals[0]
    shape = effect.shape.grid(signals, settings)[0]
    own = take.own.copy()
    own[700:] += 25.0
    others = {name: np.concatenate([values[:700], -values[700:]]) for name, values in take.others.items()}
    changed = effect.columns(replace(take, own=own, others=others), settings, shape)
    np.testing.assert_array_equal(changed[:700], effect.columns(take, settings, shape)[:700])


@pytest.mark.parametrize(
    "effect", [item for item in EFFECTS if item.dynamics.has_memory], ids=lambda item: item.name
)
def test_after_a_long_gap_it_starts_afresh(
    effect: CorrectionEffect, signals: list[Signals], settings: Settings
) -> None:
    shape = effect.shape.grid(signals, settings)[-1]
    take = first_frames(signals[0], 600)
    apart = replace(take, time_s=np.where(np.arange(600) >= 300, take.time_s + 1.5, take.time_s))
    second = joined(each_frame(apart)[300:])
    found = effect.columns(apart, settings, shape)[300:]
    np.testing.assert_allclose(found, effect.columns(second, settings, shape), atol=1e-12)
    assert np.abs(found - effect.columns(take, settings, shape)[300:]).max() > 1e-6


def test_planted_weights_and_shape_come_back(
    effect: CorrectionEffect, signals: list[Signals], settings: Settings
) -> None:
    """The own columns as truth, noise of 0.3 deg on top: least squares finds weights and shape again."""
    names = effect.weights(settings).names
    generator = np.random.default_rng(7)
    grid = effect.shape.grid(signals, settings)
    truth = len(grid) // 2
    left, weights, errors = [], {}, {}
    planted = np.concatenate([effect.columns(take, settings, grid[truth])[:, 0] for take in signals])
    strength = generator.choice([-4.0, 4.0], len(names)) / planted.std(axis=0).clip(0.05)
    target = planted @ strength + 0.3 * generator.normal(size=len(planted))
    for number, shape in enumerate(grid):
        x = np.concatenate([effect.columns(take, settings, shape)[:, 0] for take in signals])
        weights[number] = np.linalg.lstsq(x, target, rcond=None)[0]
        errors[number] = 0.3 * np.sqrt(np.diag(np.linalg.pinv(x.T @ x)))
        left.append(float(np.mean((target - x @ weights[number]) ** 2)))
    assert int(np.argmin(left)) == truth
    assert np.sqrt(min(left)) == pytest.approx(0.3, rel=0.05)
    assert (np.abs(weights[truth] - strength) < 5.0 * errors[truth]).all()


def test_described_numbers_have_units(
    effect: CorrectionEffect, signals: list[Signals], settings: Settings
) -> None:
    names = effect.weights(settings).names
    found = described(
        effect, settings, effect.shape.grid(signals, settings)[0, 0], np.arange(float(len(names)))
    )
    assert len(found) == len(names) + len(effect.shape.parameters)
    for name, value in found.items():
        assert isinstance(value, float)
        assert UNIT.search(name), name


def check_reason(reason: str | None) -> None:
    """It ends "cannot be judged: ...": no capital, no full stop, one line."""
    assert reason
    assert reason[0].islower()
    assert reason[-1] not in ".,;: \n"
    assert "\n" not in reason
    assert "None" not in reason


def test_missing_context_is_said(effect: CorrectionEffect, signals: list[Signals]) -> None:
    for name in effect.context:
        for value in (None, 3.0, np.nan):
            changed = []
            for take in signals:
                context = {key: column for key, column in take.context.items() if key != name}
                if value is not None:
                    context[name] = np.full(len(take), value)
                changed.append(replace(take, context=context))
            reason = effect.not_applicable_reason(changed)
            check_reason(reason)
            assert f"c.{name}" in str(reason)


def test_too_little_motion_is_said(signals: list[Signals]) -> None:
    still = [
        replace(take, own=np.full_like(take.own, 30.0), others={}, wearing="a", context={})
        for take in signals
    ]
    brief = [first_frames(take, 30) for take in still]
    for name in (
        "nonlinearity",
        "cross_coupling",
        "palm_arch",
        "hysteresis",
        "lag",
        "donning_shift",
        "creep",
    ):
        check_reason(correction(name).not_applicable_reason(brief))
    rigid = [replace(take, others={"PALM_ARCH": np.zeros(len(take))}) for take in signals]
    check_reason(correction("palm_arch").not_applicable_reason(rigid))
    alone = [replace(take, wearing=take.take) for take in signals]
    check_reason(correction("donning_shift").not_applicable_reason(alone))


def test_the_twin_has_the_same_freedom_and_other_columns(
    effect: CorrectionEffect, signals: list[Signals], settings: Settings
) -> None:
    shape = effect.shape.grid(signals, settings)[0]
    true = [effect.columns(take, settings, shape) for take in signals]
    twin = control_columns(effect, signals, settings, shape, np.random.default_rng(3))
    assert [columns.shape for columns in twin] == [columns.shape for columns in true]
    assert all(np.isfinite(columns).all() for columns in twin)
    for column in range(true[0].shape[2]):
        assert max(np.abs(a - b)[:, :, column].max() for a, b in zip(true, twin, strict=True)) > 1e-3


def test_an_unknown_moment_does_not_spoil_the_rest(
    effect: CorrectionEffect, signals: list[Signals], settings: Settings
) -> None:
    """At serving, a column that is not sent or is unknown counts as usual: never NaN."""
    shape = effect.shape.grid(signals, settings)[0]
    bare = replace(signals[0], context={}, others={})
    unknown = replace(
        signals[0], context={name: np.full(len(v), np.nan) for name, v in signals[0].context.items()}
    )
    for take in (bare, unknown):
        assert np.isfinite(effect.columns(take, settings, shape)).all()


def test_it_says_what_it_lacks_and_how_long_it_settles(
    effect: CorrectionEffect, signals: list[Signals], settings: Settings
) -> None:
    known = list(signals[0].context)
    assert unavailable_inputs(effect, settings, known, signals[0].wearing) is None
    if effect.context:
        assert (
            unavailable_inputs(effect, settings, [], signals[0].wearing)
            == f"context {effect.context[0]} is not sent"
        )
    transient_s = effect.dynamics.transient_s(effect.shape.grid(signals, settings)[-1], settings)
    assert (transient_s >= 1.0) == effect.dynamics.has_memory
    assert effect.dynamics.needs_time or not effect.dynamics.has_memory
    assert effect.dynamics.transient_s(np.zeros((0, len(effect.shape.parameters))), settings) == 0.0


def test_a_wearing_without_a_name_and_an_unknown_one_are_told_apart(signals: list[Signals]) -> None:
    shift = correction("donning_shift")
    settings = shift.fit_constants(signals)
    assert unavailable_inputs(shift, settings, [], "") == "nobody said which wearing this is"
    assert unavailable_inputs(shift, settings, [], "z") == "wearing 'z' was not in training"


def test_creep_settles_with_its_slow_part_and_time_itself_needs_times() -> None:
    shapes, creep = np.array([[0.6, 2.5, 10.0], [1.6, 6.3, 25.0]]), correction("creep")
    assert creep.dynamics.transient_s(shapes, {}) == 25.0
    assert creep.dynamics.transient_s(shapes, {"beside": [4.0, 1 / 64]}) == 100.0, (
        "a slower relaxation stands beside"
    )
    assert correction("lag").dynamics.transient_s(np.array([[0.05]]), {}) == 1.0
    assert [effect.dynamics.needs_time for effect in DECLARED] == [False, True, True]
    assert [effect.dynamics.has_memory for effect in DECLARED] == [False, True, False]


def test_a_play_is_known_once_the_joint_has_moved_through_it_and_after_a_gap_anew() -> None:
    time = np.concatenate([np.arange(0, 4, 0.1), np.arange(9, 11, 0.1)])
    own = np.where(time < 1, 20.0, np.where(time < 9, 31.0, 40.0))[:, None]
    play, creep = correction("hysteresis"), correction("creep")
    take = Signals(time, own)

    def unsettled(effect: CorrectionEffect, *shape: float) -> list[bool]:
        found = effect.dynamics.unsettled(take, {}, np.array([shape]))
        assert found is not None
        return found[:, 0].tolist()

    assert unsettled(play, 5.0) == ((time < 1) | (time >= 9)).tolist()
    assert all(unsettled(play, 6.0)), "twelve degrees wide, and eleven were moved"
    assert unsettled(creep, 0.1, 0.5, 2.0) == ((time < 2) | ((time >= 9) & (time < 10.95))).tolist()
