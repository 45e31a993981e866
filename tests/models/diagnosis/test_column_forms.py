"""Slow causes that no usual form has, and a context effect named by the column that measures it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from further_forms import every_form

from glovecal_models.diagnosis.column_forms import (
    LENGTHS,
    LEVEL_SHARE,
    NOISE_SHARES,
    PIECES_OF_A_TAKE,
    leaving_out,
    left_out,
)
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.text import diagnosis_sentences, named_sentence
from glovecal_models.effects.base.context_effect import ContextEffect
from glovecal_models.effects.catalogue import effect
from glovecal_models.improvement.improve import improve
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_glove import SessionGlove
from glovecal_models.simulation.session_plan import FIVE_SENSORS, SessionPlan

LAYOUT = Layout.from_columns("five", FIVE_SENSORS, FIVE_SENSORS)
PLAN = SessionPlan(seed=5, bits=12, nuisance="white")


def test_what_takes_left_out_leave_is_that_of_the_process_without_them():
    random = np.random.default_rng(2)
    error, column = random.standard_normal((6, PIECES_OF_A_TAKE)), random.random((6, PIECES_OF_A_TAKE))
    orders = np.array([np.arange(6), random.permutation(6)])
    found = left_out(error, orders, leaving_out(column))
    x, variance = column.ravel(), float(np.mean(error**2))
    take = np.repeat(np.arange(6), PIECES_OF_A_TAKE)
    length, share = LENGTHS[1], NOISE_SHARES[0]
    for draw, order in enumerate(orders):
        target = error[order].ravel()
        for out in range(6):
            rest, here = take != out, take == out
            cover = np.exp(-0.5 * ((x[:, None] - x) / length) ** 2) + LEVEL_SHARE
            noise = share * ((take[:, None] == take) + np.eye(len(x)))
            weights = np.linalg.solve((cover + noise)[np.ix_(rest, rest)] * variance, target[rest])
            expected = target[here] - variance * cover[np.ix_(here, rest)] @ weights
            assert found[len(NOISE_SHARES), draw, out] == pytest.approx(expected)


@pytest.mark.parametrize(("cause", "form"), [("warmup_drift", "oven_rings"), ("temperature", "quartz_cubic")])
def test_a_slow_cause_that_turns_back_is_named(cause, form):
    takes = record_session(PLAN, [Cause(cause, form, 2.0, ("M_PIP",))], forms_of=every_form).takes
    named = diagnose(takes, LAYOUT, judge_residual=False).named
    assert named is not None
    assert (named.effect, named.where) == (cause, ("M_PIP",))
    assert named.saved_deg is not None
    assert named.control_saved_deg is not None
    assert named.saved_deg > 3 * max(named.control_saved_deg, 0.0)


def test_equal_times_since_power_on_are_further_apart_soon_after_it():
    warm_up = effect("warmup_drift")
    assert isinstance(warm_up, ContextEffect)
    at = warm_up.evenly(np.array([0.0, 60.0, 1000.0, 1060.0]), {})
    assert at[1] - at[0] > 10 * (at[3] - at[2]) > 0


def test_pressure_in_a_form_of_its_own_is_named_by_its_column_and_added_at_once():
    """Two and a half waves over the grip: no usual form goes along with that."""
    takes = []
    for take in record_session(
        PLAN, [Cause("contact_pressure", "additive", 1e-3)], forms_of=every_form
    ).takes:
        wave = np.sin(2 * np.pi * 2.5 * take.context["contact_n"] / 8.0)
        readings = take.readings + 2.5 * SessionGlove(PLAN).gain * wave[:, None]
        takes.append(replace(take, readings=readings))
    diagnosis = diagnose(takes, LAYOUT)
    named = diagnosis.named
    assert named is not None
    assert (named.effect, named.verdict) == ("contact_pressure", "named")
    assert not diagnosis.naming.ranked
    assert len(named.where) > 1
    sentences = diagnosis_sentences(diagnosis)
    assert named_sentence(diagnosis) in sentences
    assert any(item.startswith("Until contact_pressure is added") for item in sentences)
    steps = improve(takes, LAYOUT, "anna", max_steps=1).steps
    first = steps[1].added
    assert first is not None
    assert (first.effect, first.verdict, set(first.where)) == ("contact_pressure", "named", set(named.where))
    assert steps[1].rmse_deg < 0.85 * steps[0].rmse_deg
