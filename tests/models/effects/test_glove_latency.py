"""Constant delays: what takes can tell is told, what they cannot stays a set until taps decide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.text import diagnosis_sentences
from glovecal_models.effects.base.findings import Recorded
from glovecal_models.effects.delay.clock_offset import ClockOffsetEffect
from glovecal_models.effects.delay.glove_latency import GloveLatency
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import FIVE_SENSORS, SessionPlan
from glovecal_models.takes.take import KnownLatency, Take

LAYOUT = Layout.from_columns("five", FIVE_SENSORS, FIVE_SENSORS)
DELAYS = [ClockOffsetEffect(), GloveLatency()]


def session(seed: int, *causes: Cause) -> list[Take]:
    plan = SessionPlan(seed=seed, sensors=FIVE_SENSORS, wearings=2, takes_per_wearing=3, take_s=30.0, bits=12)
    return list(record_session(plan, causes).takes)


@pytest.fixture(scope="module")
def late() -> list[Take]:
    """A reference clock that is 50 ms behind, or a glove that is 50 ms late: the takes are the same."""
    return [replace(take, reference_time_s=take.reference_time_s - 0.05) for take in session(31)]


def judged(takes: list[Take], latency_s: float | None = None) -> Diagnosis:
    known = None if latency_s is None else KnownLatency(latency_s, 0.001)
    takes = [replace(take, glove_latency=known) for take in takes]
    return diagnose(takes, LAYOUT, effects=[*DELAYS, *_lag()], signatures=False)


def _lag():
    from glovecal_models.effects.delay.lag import Lag

    return [Lag()]


def test_one_delay_of_all_takes_is_a_set_and_taps_decide(late):
    found = judged(late)
    assert found.naming.confidence_set[:2] == ("clock_offset", "glove_latency")
    assert found.named is not None
    assert found.named.verdict == "ambiguous"
    assert found.next_take is not None
    assert found.next_take.motion == "taps"
    said = " ".join(diagnosis_sentences(found))
    assert "If it is the glove, live poses are 50 ms late." in said
    assert "glovecal take latency GLOVE" in said
    assert "Offset of the reference clock: -0.050 s." in said


def test_a_measured_latency_names_one_of_them(late):
    of_the_glove = judged(late, 0.052).naming.confidence_set
    assert of_the_glove[0] == "glove_latency"
    assert "clock_offset" not in of_the_glove
    assert judged(late, 0.004).naming.confidence_set == ("clock_offset",)


def test_a_moving_average_is_no_clock():
    found = judged(session(32, Cause("glove_latency", "common_average", 3.5)))
    assert "clock_offset" not in found.naming.confidence_set
    assert {"lag", "glove_latency"} == set(found.naming.confidence_set)


def test_takes_with_offsets_of_their_own_are_clocks(late):
    each = [
        replace(take, reference_time_s=take.reference_time_s - 0.03 * number)
        for number, take in enumerate(late)
    ]
    assert judged(each).naming.confidence_set == ("clock_offset",)


def recorded(takes: list[Take]) -> Recorded:
    return Recorded(tuple(takes), {name: name for name in FIVE_SENSORS}, list)


def test_a_large_common_delay_is_a_set_too(late):
    far = [replace(take, reference_time_s=take.reference_time_s - 0.2) for take in late]
    clock, latency = DELAYS
    proposal = clock.proposed(recorded(far))
    assert proposal is not None
    assert proposal.confidence_set == ("clock_offset", "glove_latency")
    assert any("live poses are 250 ms late" in sentence for sentence in proposal.sentences)
    measured = [replace(take, glove_latency=KnownLatency(0.25, 0.002)) for take in far]
    assert clock.proposed(recorded(measured)) is None
    found = latency.proposed(recorded(measured))
    assert found is not None
    assert found.constants["latency_s"] == pytest.approx(0.25, abs=0.01)
    (back, *_) = latency.repaired(far, found.constants)
    np.testing.assert_allclose(back.reference_time_s, late[0].reference_time_s + 0.05, atol=0.01)


def test_a_reference_whose_clock_is_not_found_is_left_out_and_named(late):
    offsets = (-0.4, 0.7, -0.9, 0.5, -0.3, 3.4)
    takes = [
        replace(take, reference_time_s=take.reference_time_s + 0.05 + offset)
        for take, offset in zip(late, offsets, strict=True)
    ]
    clock = ClockOffsetEffect()
    proposal = clock.proposed(recorded(takes))
    assert proposal is not None
    assert proposal.constants["left_out"] == [takes[-1].name]
    assert proposal.confidence_set == ()
    assert any(f"The reference of take {takes[-1].name} is left out" in item for item in proposal.sentences)
    repaired = clock.repaired(takes, proposal.constants)
    assert [bool(np.isfinite(take.reference).any()) for take in repaired] == [True] * 5 + [False]
    assert clock.described(proposal.constants)["left_out"] == [takes[-1].name]


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("glove_latency", {"latency_s": 0.1}),
        ("clock_offset", {"offset_s": {}, "common_s": 0.1, "per_take": False}),
    ],
)
def test_a_model_that_repairs_its_clock_can_be_described(name, settings):
    """Its parameters are of the measurement, not of a rotation."""
    nothing = np.zeros((1, 0))
    added = AddedEffect(name, ("I_PIP",), settings, nothing, nothing, np.zeros(1))
    assert added.described() == {"I_PIP": {}}
    assert added.transient_s == 0.0
