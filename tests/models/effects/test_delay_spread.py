"""How much a delay spreads tells a filter from a mere delay, where swings change their speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from glovecal_models.diagnosis.next_take import next_take
from glovecal_models.diagnosis.problem import DiagnosisProblem
from glovecal_models.effects.base.comparison import Problem
from glovecal_models.effects.base.relations import FAST
from glovecal_models.effects.between import DELAYS
from glovecal_models.effects.catalogue import effect
from glovecal_models.effects.delay.delay_grid import delay_errors
from glovecal_models.effects.delay.delay_spread import DelaySpread, delay_spread, shows_spread
from glovecal_models.effects.delay.delay_verdict import common_delay, possible_delays
from glovecal_models.effects.delay.moved_angles import FIRST_POLE_SHARE, WINDOW_SHARE, DelayForm
from glovecal_models.layout import Layout
from glovecal_models.simulation import scene
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.protocol import PACE_S, Sweep
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import FIVE_SENSORS, SessionPlan

LAYOUT = Layout.from_columns("five", FIVE_SENSORS, FIVE_SENSORS)
SPREAD = {
    DelayForm.PURE: 0.0,
    DelayForm.DELAYED_WINDOW: WINDOW_SHARE**2 / 3,
    DelayForm.MOVING_AVERAGE: 1 / 3,
    DelayForm.TWO_POLES: FIRST_POLE_SHARE**2 + (1 - FIRST_POLE_SHARE) ** 2,
    DelayForm.ONE_POLE: 1.0,
}
"""The variance of each form's answer to an impulse, over the square of its mean."""


def with_swings(seed: int, causes: Sequence[Cause] = (), count: int = 3, rate_hz: float = 60.0) -> Problem:
    plan = SessionPlan(seed=seed, wearings=2, takes_per_wearing=3, take_s=25.0, rate_hz=rate_hz, bits=12)
    session = record_session(plan, list(causes))
    swings = [session.also("fast", 30.0, 1, repeat=number).take for number in range(count)]
    return DiagnosisProblem.of([*session.takes, *swings], LAYOUT, False, ()).design()


@pytest.fixture(scope="module")
def healthy() -> Problem:
    return with_swings(11)


def test_each_form_spreads_as_its_answer_to_an_impulse(healthy):
    found = delay_spread(healthy, 0.01)
    assert found is not None
    for form, expected in SPREAD.items():
        assert found.of_form[form] == pytest.approx(expected, abs=0.04), form


@pytest.mark.parametrize(
    ("cause", "possible", "ruled_out"),
    [
        (Cause("glove_latency", "transport", 0.65), DelayForm.PURE, DelayForm.MOVING_AVERAGE),
        (Cause("clock_offset", "constant", 0.65), DelayForm.PURE, DelayForm.MOVING_AVERAGE),
        (Cause("lag", "one_pole", 0.65), DelayForm.ONE_POLE, DelayForm.PURE),
    ],
)
def test_a_filter_of_12_ms_is_told_from_a_mere_delay(cause, possible, ruled_out):
    problem = with_swings(5, [cause])
    late_s = common_delay(delay_errors(problem)).seconds
    found = delay_spread(problem, late_s)
    assert found is not None
    assert found.may_be(possible)
    assert not found.may_be(ruled_out)


def test_swings_that_keep_their_speed_tell_nothing(monkeypatch):
    monkeypatch.setattr(scene, "FAST_SLOWEST", 1.0)
    problem = with_swings(5)
    assert delay_spread(problem, 0.012) is None
    assert not shows_spread(problem.signals)


def test_free_motion_and_no_delay_tell_nothing(healthy):
    problem = with_swings(5, count=0)
    assert delay_spread(problem, 0.012) is None
    assert not shows_spread(problem.signals)
    assert delay_spread(healthy, 0.0) is None


@pytest.mark.parametrize("rate_hz", [15.0, 100.0])
def test_what_was_recorded_is_not_asked_for_again(rate_hz):
    problem = with_swings(6, [Cause("glove_latency", "common_average", 1.3)], 1, rate_hz)
    comparisons = [comparison for name in DELAYS if (comparison := effect(name).comparison)]
    assert len(comparisons) == len(DELAYS)
    for comparison in comparisons:
        found = comparison.assess(problem)
        assert found is not None
        assert not comparison.decided_by(FAST, found, problem.signals)


def test_the_other_way_round_another_recording_may_decide():
    rivals = {name: effect(name) for name in ("lag", "hysteresis")}
    first, then = (
        next_take(list(rivals), rivals, decides)
        for decides in (lambda item, motion: True, lambda item, motion: motion != FAST)
    )
    assert first is not None
    assert then is not None
    assert (first.motion, then.motion) == ("fast", "ramps")


@pytest.mark.parametrize(
    ("share", "may_be"),
    [
        (-1.0, set()),  # it overshoots: none of the forms does
        (0.0, {DelayForm.PURE, DelayForm.DELAYED_WINDOW}),
        (0.4, {DelayForm.MOVING_AVERAGE}),
        (1.0, {DelayForm.MOVING_AVERAGE, DelayForm.ONE_POLE}),  # as an average over two frames, too
        (6.0, {DelayForm.ONE_POLE}),
    ],
)
def test_forms_that_spread_otherwise_are_ruled_out(share, may_be):
    found = DelaySpread(share, 0.01, SPREAD)
    assert {form for form in DelayForm if found.may_be(form)} == may_be
    assert found.is_mere_delay == (share == 0.0)


def test_what_is_uncertain_rules_nothing_out_but_the_impossible():
    assert all(DelaySpread(0.5, 0.5, SPREAD).may_be(form) for form in DelayForm)


def test_without_a_delay_nobody_asks_how_it_spreads(healthy):
    grids = delay_errors(healthy)
    asked = []

    def spread_of(late_s: float) -> DelaySpread:
        asked.append(late_s)
        return DelaySpread(0.0, 0.01, SPREAD)

    assert possible_delays(grids, spread_of=spread_of) == possible_delays(grids)
    assert not asked  # no delay, nothing that could spread


def test_swings_begin_slowly_and_come_to_their_speed_half_way():
    start = np.zeros(1)
    swing = Sweep(start, start - 1, start + 1, np.array([3.0]), np.zeros(1), 30.0, slowest_share=0.2)
    even = Sweep(start, start - 1, start + 1, np.array([3.0]), np.zeros(1), 30.0)
    time_s = np.arange(0.0, 30.0, 0.001)
    turns = np.flatnonzero(np.diff(np.sign(swing.driven(time_s)[:, 0])))
    hz = 0.5 / np.diff(time_s[turns])
    at = time_s[turns[1:]] % PACE_S
    assert hz[np.abs(at - PACE_S / 2) < 0.5].mean() == pytest.approx(3.0, rel=0.05)
    assert hz[(at > 9.2) | (at < 0.8)].min() == pytest.approx(0.6, rel=0.35)
    assert len(np.flatnonzero(np.diff(np.sign(even.driven(time_s)[:, 0])))) == pytest.approx(180, abs=3)
