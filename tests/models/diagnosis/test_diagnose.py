"""The whole question on simulated sessions: names, silence, delays told apart, refusals."""

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS
from glovecal_models.diagnosis.text import diagnosis_sentences
from glovecal_models.effects.base.assessment import block_starts
from glovecal_models.errors import BadInput, Cancelled
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take

SENSORS = ("I_MCP", "I_PIP")
LAYOUT = Layout.from_columns("two", SENSORS, SENSORS)


def session(seed: int, *causes: Cause) -> tuple[Take, ...]:
    plan = SessionPlan(seed=seed, sensors=SENSORS, wearings=3, takes_per_wearing=3, take_s=20.0)
    return record_session(plan, causes).takes


@pytest.fixture(scope="module")
def clean() -> tuple[Take, ...]:
    return session(11)


def test_a_clean_glove_is_left_alone(clean):
    found = diagnose(clean, LAYOUT)
    assert found.named is None
    assert not found.residual.is_significant
    assert found.next_take is None
    assert set(found.rmse_deg) == set(SENSORS)
    again = diagnose(clean, LAYOUT)
    assert diagnosis_sentences(found) == diagnosis_sentences(again), "the same takes, the same answer"
    assert [item.rmse_deg for item in found.assessments] == [item.rmse_deg for item in again.assessments]


@pytest.mark.parametrize(("seed", "takes_per_wearing"), [(11, 3), (12, 5)])
def test_two_measurements_of_one_angle_are_no_cross_coupling(seed, takes_per_wearing):
    """PIP and DIP joints bend together: of two noisy angles each says something of the other's sensor."""
    sensors = ("I_MCP", "M_PIP", "M_DIP")
    layout = Layout.from_columns("three", sensors, sensors)
    plan = SessionPlan(seed=seed, sensors=sensors, takes_per_wearing=takes_per_wearing, take_s=20.0)
    takes = record_session(plan).takes
    assert diagnose(takes, layout).named is None
    apart = replace(DIAGNOSIS_LIMITS, same_angle_share=0.0, same_angle_deg=0.0)
    named = diagnose(takes, layout, limits=apart).named
    assert named is not None
    assert named.effect == "cross_coupling"


@pytest.mark.parametrize(
    ("cause", "form"), [("hysteresis", "single_play"), ("lag", "one_pole"), ("donning_shift", "offset")]
)
def test_a_strong_cause_is_named_with_its_evidence(cause, form):
    named = diagnose(session(12, Cause(cause, form, strength_deg=2.0)), LAYOUT).named
    assert named is not None
    assert (named.effect, named.verdict) == (cause, "named")
    assert named.saved_deg is not None
    assert named.control_saved_deg is not None
    assert named.saved_deg > 2 * max(named.control_saved_deg, 0.0)


def test_loops_that_cross_in_mid_range_are_hysteresis():
    """A butterfly: the play times the distance from a crossing point. No simulated cause has it."""
    changed = []
    for take in session(14):
        readings = take.readings.copy()
        for column in range(readings.shape[1]):
            own, play, behind = readings[:, column], readings[0, column], np.empty(len(readings))
            for frame, now in enumerate(own):
                play = min(max(play, now - 12.0), now + 12.0)
                behind[frame] = (now - play) / 12.0
            readings[:, column] = own + 12.0 * behind * (own - np.median(own)) / np.ptp(own)
        changed.append(replace(take, readings=readings))
    named = diagnose(changed, LAYOUT).named
    assert named is not None
    assert named.effect == "hysteresis"


def test_a_reference_ahead_of_its_sensor_is_no_lag(clean):
    late = [replace(take, reference_time_s=take.reference_time_s + 0.06) for take in clean]
    found = diagnose(late, LAYOUT)
    assert found.naming.confidence_set == ("clock_offset",)
    assert found.naming.ranked[0].shapes[0] == pytest.approx([-0.06], abs=0.006)


def test_what_cannot_be_judged_is_said(clean):
    bare = [replace(take, context={}, wearing="one") for take in clean]
    why = {item.effect: item.why for item in diagnose(bare, LAYOUT).not_identifiable}
    assert why["warmup_drift"] == "no context column c.power_on_s was recorded"
    assert why["donning_shift"] == "all takes are of one wearing"


def test_an_unfamiliar_column_is_called_by_its_name():
    takes = session(13)
    random = np.random.default_rng(1)
    changed = []
    for take in takes:
        strap = np.sin(take.time_s / 3 + random.uniform(0, 6))
        readings = take.readings + 6.0 * (strap**2)[:, None]
        changed.append(replace(take, readings=readings, context={**take.context, "strap_n": strap}))
    assert diagnose(changed, LAYOUT).naming.confidence_set[0] == "context:strap_n"


def test_takes_without_reference_are_refused(clean):
    bare = [
        replace(take, rotations=(), reference_time_s=np.empty(0), reference=np.empty((0, 0)))
        for take in clean
    ]
    with pytest.raises(BadInput, match="no take measured a rotation"):
        diagnose(bare, LAYOUT)


def test_it_can_be_cancelled_in_the_middle(clean):
    asked = iter([False, False, False])
    with pytest.raises(Cancelled):
        diagnose(clean, LAYOUT, cancelled=lambda: next(asked, True))


def test_a_few_seconds_are_too_little(clean):
    short = replace(
        clean[0], time_s=clean[0].time_s[:300], readings=clean[0].readings[:300],
        reference_time_s=clean[0].time_s[:300], reference=clean[0].reference[:300],
        context={name: values[:300] for name, values in clean[0].context.items()},
    )  # fmt: skip
    sentences = diagnosis_sentences(diagnose([short], LAYOUT))
    assert any(sentence.startswith("Too few data to judge any effect") for sentence in sentences)


def test_a_take_without_a_row_of_a_joint_has_no_block() -> None:
    assert block_starts([6, 0, 4, 0], 3).tolist() == [0, 3, 6]
