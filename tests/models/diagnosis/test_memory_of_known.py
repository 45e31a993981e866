"""What the model's own effects explain by what they are is no second cause."""

from __future__ import annotations

import numpy as np
import pytest
from further_forms import every_form

from glovecal_models.diagnosis import actions
from glovecal_models.diagnosis.candidates import is_memory_of_known
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.problem import DiagnosisProblem
from glovecal_models.diagnosis.residual_association import ResidualAssociation
from glovecal_models.diagnosis.text import within_known_sentence
from glovecal_models.effects.base.assessment import HeldOutRmse
from glovecal_models.effects.catalogue import effect, relations
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
ARCH = KnownEffect(effect("palm_arch"), JOINTS, (np.empty(0),) * len(JOINTS))


def takes_with(*causes: Cause) -> tuple[Take, ...]:
    plan = SessionPlan(seed=12, sensors=SENSORS, take_s=24.0)
    return record_session(plan, causes, forms_of=every_form).takes


@pytest.mark.parametrize(
    ("causes", "is_of_known"),
    [
        ((Cause("palm_arch", "sticks_to_palm", 3.0),), True),
        ((Cause("palm_arch", "linear", 3.0), Cause("hysteresis", "several_plays", 2.0)), False),
    ],
    ids=["the arch sticks", "the sensor sticks"],
)
def test_a_memory_follows_the_joint_or_what_a_known_effect_adds(causes, is_of_known):
    takes = takes_with(*causes)
    design = DiagnosisProblem.of(takes, LAYOUT, False, (ARCH,)).design()
    place = design.rotations.index("R_MCP")
    assert is_memory_of_known(design, effect("hysteresis"), place) is is_of_known


def test_nothing_is_a_memory_of_effects_that_remember_by_themselves():
    creep = KnownEffect(effect("creep"), JOINTS, (np.array([0.5, 2.0, 8.0]),) * len(JOINTS))
    takes = takes_with(Cause("hysteresis", "several_plays", 2.0))
    design = DiagnosisProblem.of(takes, LAYOUT, False, (creep,)).design()
    assert not any(is_memory_of_known(design, effect("hysteresis"), place) for place in range(3))


def test_what_the_arch_does_by_itself_is_not_named():
    found = diagnose(takes_with(Cause("palm_arch", "sticks_to_palm", 3.0)), LAYOUT, known=(ARCH,))
    assert not found.naming.ranked
    refused = [item for item in found.assessments if item.of_known]
    assert {item.effect for item in refused} == {"hysteresis", "creep"}
    assert "a memory of what the model's effects add there" in within_known_sentence(refused[0])


@pytest.mark.parametrize(("whole", "is_within"), [("garment_slip", True), ("saturation", False)])
def test_an_action_is_held_against_an_effect_that_others_explain_a_part_of(monkeypatch, whole, is_within):
    """Of a glove that slips: creep of the true angle saves 2 %, and its slow part zeroes each take."""
    monkeypatch.setattr(actions, "formed_rmse", lambda *_: HeldOutRmse(3.108, 3.070, 3.472))
    design = DiagnosisProblem.of(takes_with(), LAYOUT, False, ()).design()
    asked = [ResidualAssociation("I_MCP", "time in take", "the time in the take", 1.0, 0.01)]
    [found] = actions.actions_for(
        asked, design, LAYOUT, set(), linear=False, wholes=(relations().whole(whole),)
    )
    assert (found.effect, found.saves) == ("creep", True)
    assert found.is_within_known is is_within
