"""Too few wearings or takes to tell a cause from chance: said, with the recording that decides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.next_take import Undecidable, undecidable
from glovecal_models.diagnosis.text import residual_sentence
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.catalogue import stored_correction
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take

SENSORS = ("I_MCP", "I_PIP")
LAYOUT = Layout.from_columns("two", SENSORS, SENSORS)


def signals(wearings: Sequence[str], temperatures: Sequence[float] = (), motions: str = "") -> list[Signals]:
    """Takes of 30 s, told by wearing, temperature and motion ("" for none) alone."""
    time = np.linspace(0, 30, 4)
    values = temperatures or [20.0] * len(wearings)
    return [
        Signals(
            time, np.zeros((4, 1)), context={"temperature_c": np.full(4, value)}, wearing=wearing,
            take=f"{wearing}-{motion}",
        )
        for wearing, value, motion in zip(wearings, values, motions or [""] * len(wearings), strict=True)
    ]  # fmt: skip


def why_not(takes: Sequence[Signals], name: str) -> Undecidable:
    found = undecidable(takes, stored_correction(name, {}))
    assert found is not None
    return found


@pytest.fixture(scope="module")
def shifted() -> tuple[Take, ...]:
    plan = SessionPlan(seed=12, sensors=SENSORS, wearings=3, takes_per_wearing=3, take_s=20.0)
    return record_session(plan, (Cause("donning_shift", "offset", strength_deg=3.0),)).takes


def test_two_wearings_of_four_motions_ask_for_a_third():
    found = why_not(signals("aaaabbbb", motions="klmnklmn"), "donning_shift")
    assert found.why == (
        "two wearings allow 8 permutations of their takes, a donning shift needs 25 to be significant: record"
        " a third wearing with 4 takes"
    )
    assert found.record.seconds == 120
    assert found.record.separates == ("donning_shift", "chance")
    assert "put it on again and record 4 takes" in found.record.what


def test_what_is_asked_for_is_enough():
    three = signals("aaaabbbbcccc", motions="klmnklmnklmn")
    assert undecidable(three, stored_correction("donning_shift", {})) is None
    assert undecidable(signals("aaabbbccc"), stored_correction("donning_shift", {})) is None
    assert "a third wearing with 3 takes" in why_not(signals("aabb"), "donning_shift").why


@pytest.mark.parametrize(
    ("degrees", "ways", "needed", "more"),
    [
        ((20, 25), 2, 200, 4),
        ((20, 22, 24, 26), 24, 200, 2),
        ((20,) * 9 + (30,), 10, 200, 2),
        ((20,) * 19 + (30,), 20, 40, 1),
    ],
)
def test_few_takes_of_a_context_ask_for_other_values(degrees, ways, needed, more):
    """More in few takes."""
    takes = signals("a" * len(degrees), degrees)
    found = why_not(takes, "temperature")
    assert f"allow {ways} permutations, temperature needs {needed} to" in found.why
    assert f"record {more} more take" in found.why
    added = [*degrees, *(40.0 + 5 * number for number in range(more))]
    assert undecidable(signals("a" * len(added), added), stored_correction("temperature", {})) is None


def test_a_shift_between_two_wearings_is_no_verdict_but_a_next_take(shifted):
    found = diagnose(shifted[:6], LAYOUT)
    assert found.named is None
    assert "donning_shift" not in {item.effect for item in found.assessments}
    why = {item.effect: item.why for item in found.not_identifiable}["donning_shift"]
    assert why.startswith("two wearings allow 10 permutations of their takes, a donning shift needs 25")
    assert found.next_take is not None
    assert found.next_take.separates == ("donning_shift", "chance")
    assert found.next_take.seconds == 60
    sentence = residual_sentence(found.residual)
    assert "Possible cause that these takes cannot decide: donning_shift or" in sentence


def test_the_third_wearing_decides(shifted):
    found = diagnose(shifted, LAYOUT)
    assert found.naming.confidence_set == ("donning_shift",)
    assert "donning_shift" not in {item.effect for item in found.not_identifiable}


def test_a_constant_column_says_what_to_record(shifted):
    takes = [
        replace(take, context={**take.context, "temperature_c": np.full(len(take.time_s), 21.0)})
        for take in shifted[:2]
    ]
    why = {item.effect: item.why for item in diagnose(takes, LAYOUT).not_identifiable}
    assert why["temperature"].endswith("never changes (21); record takes in which it differs")
