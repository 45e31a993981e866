"""What is found by its signature, and what is ranked by the error it saves: which of them is named first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.naming import Naming, also_found, parts_of, saved_share_of
from glovecal_models.diagnosis.signatures import is_outweighed, may_explain
from glovecal_models.diagnosis.text import part_sentence
from glovecal_models.effects.base.assessment import Assessment, JointErrors
from glovecal_models.effects.base.findings import Finding
from glovecal_models.effects.catalogue import catalogue, effect, relations
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan

BLOCKS = 36
SENSOR_OF = {"J0": "J0", "J1": "J1"}


def ranked(name: str, saved: float, joints: int = 2, square: float = 4.0) -> Assessment:
    """An effect that saves this share of a squared error of ``square`` per row on every joint."""
    take = np.repeat(np.arange(12), BLOCKS // 12)
    base = np.full(BLOCKS, 100 * square)
    errors = tuple(JointErrors(base, (1 - saved) * base, base, 100 * BLOCKS, take) for _ in range(joints))
    nothing = tuple(np.empty(0) for _ in range(joints))
    names = tuple(f"J{number}" for number in range(joints))
    return Assessment(name, names, errors, nothing, nothing, p_value=0.004)


def naming(*items: Assessment) -> Naming:
    return Naming(items, (items[0].effect,) if items else ())


def slip(*accounts_for: str) -> Finding:
    return Finding("garment_slip", ("J0",), "it slips", size_deg=1.0, accounts_for=accounts_for)


def test_a_slip_is_behind_what_explains_a_part_of_it_only():
    garment_slip = effect("garment_slip")
    assert may_explain(garment_slip, naming(), [slip()], catalogue())
    assert may_explain(garment_slip, naming(ranked("temperature", 0.4, square=1.0)), [slip()], catalogue())
    assert not may_explain(garment_slip, naming(ranked("temperature", 0.7)), [slip()], catalogue())
    assert not may_explain(garment_slip, naming(ranked("hysteresis", 0.2)), [slip()], catalogue())


def test_a_slip_is_not_behind_what_explains_far_more_than_it_is_large():
    both = naming(ranked("warmup_drift", 0.4), ranked("temperature", 0.2))
    assert not may_explain(effect("garment_slip"), both, [slip()], catalogue())
    assert may_explain(effect("garment_slip"), both, [replace(slip(), size_deg=1.5)], catalogue())


def test_offsets_of_wearings_that_are_not_needed_beside_a_slip_do_not_hide_it():
    wearings = naming(ranked("donning_shift", 0.7))
    assert may_explain(effect("garment_slip"), wearings, [slip("donning_shift")], catalogue())
    assert not may_explain(effect("garment_slip"), wearings, [slip("donning_shift"), slip()], catalogue())


def test_slips_that_are_larger_than_the_wearings_come_first():
    wearings = naming(ranked("donning_shift", 0.7, square=0.5))
    assert may_explain(effect("garment_slip"), wearings, [slip("donning_shift"), slip()], catalogue())


SLIPS = relations().whole("garment_slip")


def test_beside_a_known_slip_a_column_has_to_explain_more_than_a_part():
    found = [ranked("temperature", 0.4), ranked("temperature", 0.7), ranked("hysteresis", 0.4)]
    kept = [bool(item.significant_joints) for item in parts_of(found, [SLIPS])]
    assert kept == [False, True, True]
    refused = parts_of(found, [SLIPS])[0]
    assert not refused.within_known
    assert "more than a part of garment_slip" in part_sentence(refused)
    assert all(item.significant_joints for item in parts_of(found, []))


def test_the_share_is_that_of_all_significant_joints_together():
    assert saved_share_of(ranked("temperature", 0.4)) == pytest.approx(0.4)


@pytest.mark.parametrize(("error_square", "outweighed"), [(0.1, True), (2.0, False), (None, False)])
def test_a_small_fault_comes_after_what_explains_far_more(error_square, outweighed):
    fault = Finding("sensor_fault", ("J0",), "it drops out once", error_square=error_square)
    assert is_outweighed([fault], naming(ranked("lag", 0.6))) is outweighed
    assert not is_outweighed([fault], naming())


def test_what_saves_half_of_what_is_left_is_no_rest_of_a_form():
    items = [ranked("supply_sag", share) for share in (0.3, 0.8)]
    known = [replace(item, known_saved_square=(50.0, 50.0)) for item in items]
    assert [bool(item.significant_joints) for item in known] == [False, True]


@pytest.mark.parametrize(
    ("where", "expected"), [("J0", ("hysteresis", "sensor_fault")), ("J5", ("hysteresis",))]
)
def test_a_sensor_that_jumps_where_hysteresis_saves_error_may_be_either(where, expected):
    fault = Finding("sensor_fault", (where,), "it jumps", rivals=("hysteresis",))
    assert also_found(naming(ranked("hysteresis", 0.3)), [fault], SENSOR_OF).confidence_set == expected


def test_a_ranked_effect_that_is_no_rival_of_a_finding_stays_alone():
    found = naming(ranked("lag", 0.3))
    fault = Finding("sensor_fault", ("J0",), "it jumps", rivals=("hysteresis",))
    assert also_found(found, [fault], SENSOR_OF) == found


def test_repeated_frames_are_dropped_before_a_take_is_asked_for_that_tells_apart_what_they_look_like():
    causes = [Cause("repeated_samples", "padded_at_random", strength_deg=1.0)]
    plan = SessionPlan(seed=3, rate_hz=100.0, bits=12, wearings=2, takes_per_wearing=3, take_s=25.0)
    document = {"name": "five", "sensors": list(plan.sensors)}
    layout = Layout.from_document(document | {"rotations": {name: [name] for name in plan.sensors}})
    found = diagnose(record_session(plan, causes).takes, layout)
    assert found.named is not None
    assert found.named.confidence_set == ("repeated_samples",)
    assert len(found.naming.confidence_set) > 1, "a delay, as far as the error tells"
    assert found.next_take is None or not set(found.next_take.separates) & set(found.naming.confidence_set)
