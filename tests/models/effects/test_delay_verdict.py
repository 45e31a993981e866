"""Forms of delay: a filter is named before a mere delay only where it clearly explains more."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.diagnosis.problem import DiagnosisProblem
from glovecal_models.effects.delay.delay_grid import DelayErrors, DelayForm, delay_errors, short_delay_errors
from glovecal_models.effects.delay.delay_verdict import possible_delays
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import FIVE_SENSORS, SessionPlan

LAYOUT = Layout.from_columns("five", FIVE_SENSORS, FIVE_SENSORS)

DELAYS_S = np.array([-0.02, 0.0, 0.02, 0.04])


def errors(lowpass_gain: float) -> DelayErrors:
    """Of 48 blocks in 4 takes, 20 ms late; a pole leaves less by so much of the motion, with scatter."""
    generator = np.random.default_rng(3)
    fast, scatter = generator.uniform(0.2, 2.0, 48), generator.normal(0.0, 0.1, 48)
    blocks, forms = [], []
    for form in DelayForm:
        less = {DelayForm.PURE: 0.0, DelayForm.ONE_POLE: lowpass_gain}.get(form, -2.0)
        for delay in DELAYS_S:
            away = abs(delay - 0.02) / 0.02
            blocks.append(5.0 + fast * (2.0 * away - less) + (scatter if form else 0.0))
            forms.append(form)
    return DelayErrors(
        np.array(forms), np.tile(DELAYS_S, len(DelayForm)), np.stack(blocks, axis=1),
        5.0 + 4.0 * fast, np.repeat(np.arange(4), 12), fast, 6000,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("lowpass_gain", "named"),
    [(0.04, ("clock_offset", "glove_latency", "lag")), (1.0, ("lag",))],
)
def test_a_mere_delay_comes_first_until_it_is_ruled_out(lowpass_gain, named):
    assert possible_delays([errors(lowpass_gain)]) == named


@pytest.mark.parametrize(("form", "ruled_out"), [("transport", "lag"), ("common_average", "clock_offset")])
def test_in_fast_motion_20_ms_are_told_from_a_filter(form, ruled_out):
    plan = SessionPlan(seed=5, wearings=2, takes_per_wearing=3, take_s=25.0, rate_hz=100.0)
    session = record_session(plan, [Cause("glove_latency", form, 1.0)])
    fast = [session.also("fast", 25.0, 1, repeat=number).take for number in range(2)]
    problem = DiagnosisProblem.of([*session.takes, *fast], LAYOUT, False, ()).design()
    possible = possible_delays(delay_errors(problem))
    assert "glove_latency" in possible
    assert ruled_out not in possible


def test_short_blocks_hold_the_same_errors_as_long_ones():
    takes = record_session(SessionPlan(seed=5, wearings=1, takes_per_wearing=2, take_s=23.0)).takes
    problem = DiagnosisProblem.of(takes, LAYOUT, False, ()).design()
    for short, long in zip(short_delay_errors(problem), delay_errors(problem), strict=True):
        assert len(short.take) > 4 * len(long.take)
        for take in range(2):
            some, all_of_it = short.blocks[short.take == take], long.blocks[long.take == take]
            np.testing.assert_allclose(some.sum(axis=0), all_of_it.sum(axis=0))
        np.testing.assert_allclose(short.unmoved.sum(), long.unmoved.sum())
