"""One plan of takes for all that takes cannot decide; what it says opens effects does."""

from __future__ import annotations

from dataclasses import replace
from typing import cast, get_args

import numpy as np
import pytest

from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.next_take import LackingTakes, Wanted, asked_take
from glovecal_models.diagnosis.residual_answer import TakePlan
from glovecal_models.diagnosis.text import diagnosis_sentences, missing_effects
from glovecal_models.effects.base.relations import CROSSED, RAMPS, TAPS
from glovecal_models.layout import Layout
from glovecal_models.simulation.session import RecordedSession, record_session
from glovecal_models.simulation.session_plan import SessionPlan, TakeMotion
from glovecal_models.takes.take import Take

SENSORS = ("I_MCP", "I_PIP", "M_MCP")
LAYOUT = Layout.from_columns("three", SENSORS, SENSORS)
SESSIONS = {
    "four of 6 s": SessionPlan(seed=4, sensors=SENSORS, wearings=1, takes_per_wearing=4, take_s=6.0),
    "one of 20 s": SessionPlan(seed=5, sensors=SENSORS, wearings=1, takes_per_wearing=1, take_s=20.0),
    "four of 20 s": SessionPlan(seed=6, sensors=SENSORS, wearings=1, takes_per_wearing=4, take_s=20.0),
    "put on twice": SessionPlan(seed=7, sensors=SENSORS, wearings=2, takes_per_wearing=3, take_s=20.0),
    "put on for each": SessionPlan(seed=8, sensors=SENSORS, wearings=2, takes_per_wearing=1, take_s=20.0),
    "still": SessionPlan(
        seed=9, sensors=SENSORS, wearings=1, takes_per_wearing=3, take_s=20.0, motions=("still",) * 3
    ),
    "slow": SessionPlan(
        seed=10, sensors=SENSORS, wearings=1, takes_per_wearing=2, take_s=7.0, motions=("holds",) * 2
    ),
}
NO_TAKE_SHOWS = {"contact_pressure", "palm_arch", "no_effect"}
"""A column or sensor that these gloves do not have; and nothing."""


def recorded_by(plan: TakePlan, session: RecordedSession) -> list[Take]:
    """The wearer does as told, step by step."""
    takes, wearing = list(session.takes), session.plan.wearings - 1
    for number, planned in enumerate(plan.each_take):
        wearing, step = wearing + planned.is_put_on_anew, planned.step
        motion = cast(TakeMotion, step.motion) if step.motion in get_args(TakeMotion) else "natural"
        take = session.also(motion, float(step.seconds), wearing, repeat=number).take
        takes.append(replace(take, name=planned.name))
    return takes


def undecided(diagnosis: Diagnosis) -> set[str]:
    """Effects without a verdict, those that too little was recorded for included."""
    blocks = max((len(each.base) for item in diagnosis.assessments for each in item.errors), default=0)
    few = {item.effect for item in diagnosis.assessments if blocks < diagnosis.limits.fewest_blocks}
    return {item.effect for item in diagnosis.not_identifiable} | few


@pytest.mark.parametrize("name", SESSIONS)
def test_what_a_plan_opens_is_decided_once_it_is_recorded(name: str) -> None:
    session = record_session(SESSIONS[name])
    before = diagnose(session.takes, LAYOUT)
    assert before.take_plan is not None
    opened = set(before.take_plan.opens)
    assert undecided(before) - NO_TAKE_SHOWS == opened
    after = diagnose(recorded_by(before.take_plan, session), LAYOUT)
    assert undecided(after) & opened == set()
    assert after.take_plan is None


def test_nothing_is_planned_where_nothing_is_missing() -> None:
    plan = SessionPlan(seed=11, sensors=SENSORS, wearings=3, takes_per_wearing=4, take_s=20.0)
    diagnosis = diagnose(record_session(plan).takes, LAYOUT)
    assert undecided(diagnosis) <= NO_TAKE_SHOWS
    assert diagnosis.take_plan is None
    assert missing_effects(diagnosis).take_plan is None


def test_the_plan_stands_once_and_reasons_only_for_what_no_take_shows() -> None:
    diagnosis = diagnose(record_session(SESSIONS["four of 6 s"]).takes, LAYOUT)
    assert diagnosis.take_plan is not None
    sentences = diagnosis_sentences(diagnosis)
    assert sentences.count(diagnosis.take_plan.heading) == 1
    assert set(diagnosis.take_plan.sentences) < set(sentences)
    reasons = [sentence for sentence in sentences if sentence.startswith("Not identifiable")]
    assert len(reasons) == 2
    assert not any("permutations" in sentence for sentence in sentences)
    answer = missing_effects(diagnosis)
    assert len(answer.not_shown) == 2
    assert {item.effect for item in answer.not_identifiable} >= {"creep", "donning_shift", "temperature"}
    assert answer.next_command == diagnosis.take_plan.steps[0].command


def test_a_column_that_never_changes_wants_takes_at_other_values() -> None:
    session = record_session(SESSIONS["put on twice"])
    takes = [
        replace(take, context={**take.context, "temperature_c": np.full(len(take.time_s), 21.0)})
        for take in session.takes
    ]
    plan = diagnose(takes, LAYOUT).take_plan
    assert plan is not None
    assert plan.columns == ("temperature_c",)
    assert "temperature" in plan.opens
    assert plan.sentences[-1] == "In each take let this differ from all before: c.temperature_c."


def test_takes_that_serve_several_effects_are_recorded_once() -> None:
    wanted = {
        "a": (Wanted(motion=RAMPS),),
        "b": (Wanted(motion=RAMPS), Wanted(2)),
        "c": (Wanted(4, column="x"),),
        "d": (Wanted(3, wearings=1, names=("x", "y", "z")),),
    }
    plan = LackingTakes(wanted, each_s=35).plan()
    assert plan is not None
    steps = [(step.takes, step.seconds, step.motion) for step in plan.steps]
    assert steps == [(3, 40, "ramps"), (3, 35, "more_wearings")]
    assert [step.opens for step in plan.steps] == [("a", "b"), ("c", "d")]
    assert plan.heading.startswith("6 further takes (3 min 45 s in all)")
    each = [(take.name, take.is_put_on_anew) for take in plan.each_take]
    assert each == [*[("ramps", False)] * 3, ("x", True), ("y", False), ("z", False)]
    alone = LackingTakes({"c": wanted["c"]}).plan()
    assert alone is not None
    assert [(step.takes, step.motion, step.opens) for step in alone.steps] == [(4, "more_takes", ("c",))]


def test_what_separates_rivals_comes_first_and_taps_are_no_take() -> None:
    lacking = LackingTakes({"c": (Wanted(3),)})
    crossed = asked_take(CROSSED.name, CROSSED.what, CROSSED.seconds, ("a", "b"), CROSSED.takes)
    plan = lacking.plan(crossed)
    assert plan is not None
    [step] = plan.steps
    assert (step.takes, step.seconds, step.separates, step.opens) == (9, 20, ("a", "b"), ("c",))
    assert "Tells apart: a, b." in plan.sentences[0]
    assert LackingTakes().plan(asked_take(TAPS.name, TAPS.what, 40, ("a", "b"))) is None
    assert lacking.plan(asked_take("more_takes", "", 9, ("c", "chance"))) == lacking.plan()
