"""The rules of a diagnosis: their order can be read, each says what it changed, and each can be left out."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from glovecal_models.diagnosis.diagnose import asked, concluded, diagnose
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.rules import RULES, states
from glovecal_models.diagnosis.state import Choices, State
from glovecal_models.effects.base.findings import Finding
from glovecal_models.effects.catalogue import effect
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take

SENSORS = ("I_MCP", "R_MCP", "P_MCP", "PALM_ARCH")
JOINTS = SENSORS[:3]
LAYOUT = Layout.from_document(
    {"name": "palm", "sensors": list(SENSORS), "rotations": {name: [name] for name in JOINTS}}
)


@cache
def takes() -> tuple[Take, ...]:
    """Of sensors that stick."""
    plan = SessionPlan(seed=12, sensors=SENSORS, take_s=24.0)
    return record_session(plan, [Cause("hysteresis", "several_plays", 2.0)]).takes


@cache
def start() -> State:
    return asked(takes(), LAYOUT, Choices())


def ended(state: State, *without: str) -> State:
    *_, last = states(replace(state, question=replace(state.question, without=frozenset(without))))
    return last


def test_every_rule_has_a_name_of_its_own_and_says_what_it_does() -> None:
    assert len({rule.name for rule in RULES}) == len(RULES)
    assert all((rule.apply.__doc__ or "").rstrip().endswith(".") for rule in RULES)


def test_a_diagnosis_is_its_rules_one_after_another() -> None:
    found, whole = diagnose(takes(), LAYOUT), concluded(ended(start()))
    assert found.decided == whole.decided
    assert found.named == whole.named
    assert found.residual == whole.residual


def test_rules_say_what_they_decided_in_their_order() -> None:
    decided = ended(start()).decided
    names = [rule.name for rule in RULES]
    places = [names.index(item.rule) for item in decided]
    assert places == sorted(places)
    assert "rank" in names
    ranked = next(item for item in decided if item.rule == "rank")
    assert ranked.effects[0] == "hysteresis"
    assert ranked.sentence.startswith("hysteresis on ")
    assert all(item.sentence.endswith(".") for item in decided)


def test_a_rule_that_is_left_out_decides_nothing() -> None:
    usual, without = ended(start()), ended(start(), "unsettled_start", "healthy_error")
    assert {"unsettled_start"} <= {item.rule for item in usual.decided}
    assert not {"unsettled_start", "healthy_error"} & {item.rule for item in without.decided}
    assert without.settled is without.rest


def test_what_the_model_has_is_not_asked_for_again() -> None:
    known = KnownEffect(effect("lag"), ("I_MCP",), (np.array([0.03]),))
    begun = asked(takes(), LAYOUT, Choices(known=(known,)))
    decided = ended(begun).decided
    [residue] = [item for item in decided if item.rule == "residue_of_known"]
    assert set(residue.effects) == {"clock_offset", "glove_latency"}
    anyway = ended(begun, "residue_of_known")
    assert "clock_offset" in {item.effect for item in anyway.assessments}


@pytest.mark.parametrize("rule", [rule.name for rule in RULES if not rule.is_evidence])
def test_a_diagnosis_ends_without_any_rule(rule: str) -> None:
    """On evidence that is there already."""
    *_, compared = states(start(), RULES[:2])
    rest = replace(compared, question=replace(compared.question, without=frozenset({rule})))
    *_, last = states(rest, RULES[2:14])
    assert rule not in {item.rule for item in last.decided}


def test_one_sensor_fails_and_a_glove_slips_as_a_whole() -> None:
    rule = next(rule for rule in RULES if rule.name == "part_of_finding")
    stuck = Finding("sensor_fault", ("I_MCP",), "I_MCP stands still.", kind="stuck")
    changed = replace(stuck, sentence="I_MCP answers less.", kind="changed", part_of=("garment_slip",))
    at_it, elsewhere = (
        Finding("garment_slip", where, "The error wanders.") for where in (("I_MCP",), ("I_MCP", "R_MCP"))
    )

    def told(*findings: Finding) -> State:
        return rule.apply(replace(start(), findings=findings))

    for alone in ((changed,), (changed, at_it), (stuck, elsewhere)):
        assert told(*alone).findings == alone
    both = told(stuck, changed, elsewhere)
    assert both.findings == (stuck, elsewhere)
    assert both.decided[-1].effects == ("sensor_fault",)
    assert both.decided[-1].sentence.endswith("a part of garment_slip, found at other sensors too.")


def test_a_slip_that_alone_makes_takes_likely_leaves_nothing_for_a_column_that_goes_along() -> None:
    plan = SessionPlan(seed=5, sensors=("I_MCP", "M_MCP", "R_MCP"), take_s=30.0, rate_hz=30.0)
    session = record_session(plan, (Cause("garment_slip", "to_one_side", 1.5),))
    layout = Layout.from_document(
        {
            "name": "slips",
            "sensors": list(plan.sensors),
            "rotations": {name: [name] for name in plan.sensors},
            "counts": [1, 255],
        }
    )
    state = asked(session.takes, layout, Choices(linear=False))
    [with_it, without] = (concluded(ended(state, *rules)).named for rules in ((), ("needless_parts",)))
    assert with_it is not None
    assert without is not None
    assert with_it.effect == without.effect == "garment_slip"
    assert set(without.confidence_set) - set(with_it.confidence_set) == {"temperature"}
