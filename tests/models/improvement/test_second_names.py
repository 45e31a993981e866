"""What the form of a right first effect leaves is no second cause, and one joint does not decide for all.

Simulated gloves of six joints drawn from the whole hand; the limits were chosen on these seeds among others.
"""

from __future__ import annotations

import numpy as np
import pytest
from further_forms import every_form

from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS
from glovecal_models.diagnosis.naming import is_beside_known, with_known_saved, with_other_share
from glovecal_models.diagnosis.text import within_known_sentence
from glovecal_models.effects.base.assessment import Assessment, JointErrors
from glovecal_models.effects.base.findings import Finding
from glovecal_models.effects.catalogue import effect
from glovecal_models.improvement.improve import improve
from glovecal_models.improvement.improvement import Improvement
from glovecal_models.improvement.text import improvement_sentences
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan


def improved(seed: int, sensors: tuple[str, ...], *causes: Cause, max_steps: int = 6) -> Improvement:
    takes = record_session(
        SessionPlan(seed=seed, sensors=sensors, take_s=32.0), causes, forms_of=every_form
    ).takes
    layout = Layout.from_document(
        {"name": "six", "sensors": list(sensors), "rotations": {name: [name] for name in sensors}}
    )
    settings = TrainingSettings(samples=150, folds=2)
    return improve(list(takes), layout, "anna", settings, max_steps=max_steps)


def added(found: Improvement) -> list[str]:
    return [step.added.effect for step in found.steps if step.added is not None]


@pytest.fixture(scope="module")
def sticky() -> Improvement:
    sensors = ("T_VIR", "I_MCP", "I_DIP", "R_PIP", "MR_ABD", "P_DIP")
    return improved(1009, sensors, Cause("hysteresis", "bouc_wen", 2.0))


def test_what_a_form_leaves_is_not_named(sticky):
    assert added(sticky) == ["hysteresis"]
    assert sticky.diagnosis is not None
    refused = {item.effect: item for item in sticky.diagnosis.assessments if item.within_known}
    assert "creep" in refused
    assert "the model's effects save" in within_known_sentence(refused["creep"])


def delay(square: float) -> Assessment:
    """That saves 15 % of a joint's error of so many degrees squared, in 36 blocks of 5 s."""
    base = np.full(36, 100 * square)
    errors = JointErrors(base, 0.85 * base, 1.1 * base, 3600, np.repeat(np.arange(12), 3))
    return Assessment("lag", ("I_PIP",), (errors,), (np.empty(0),), (np.empty(0),))


@pytest.mark.parametrize(
    ("known", "saved", "is_named"),
    [
        (("creep",), 2.5, True),
        (("hysteresis",), 2.5, True),
        (("hysteresis",), 5.0, False),
        (("cross_coupling",), 2.5, False),
        (("creep", "cross_coupling"), 2.5, False),
    ],
)
def test_a_delay_may_save_less_beside_what_leaves_hardly_anything_like_it(known, saved, is_named):
    """6 or 3 % of what the model's effects save."""
    effects = [effect(name) for name in known]
    found = with_known_saved([delay(1.0)], {"I_PIP": saved})
    for mimics in (True, False):
        found = with_other_share(found, effects, DIAGNOSIS_LIMITS, mimics=mimics)
    assert bool(found[0].significant_joints) is is_named
    assert bool(found[0].within_known) is not is_named


def test_a_second_cause_as_strong_as_the_first_is_named():
    sensors = ("I_MCP", "I_PIP", "M_MCP", "M_PIP", "R_MCP")
    found = improved(
        4, sensors, Cause("creep", "one_exponential", 2.0), Cause("supply_sag", "gain_power", 2.0),
        max_steps=2,
    )  # fmt: skip
    assert set(added(found)) == {"creep", "supply_sag"}


@pytest.mark.slow
def test_a_form_that_moves_the_regressor_is_learned_until_both_agree():
    sensors = ("I_MCP", "I_PIP", "M_MCP", "M_PIP", "R_MCP")
    found = improved(12, sensors, Cause("creep", "lost_structure", 2.0))
    assert added(found) == ["creep"]
    assert found.steps[-1].rmse_deg < 0.8 * found.steps[0].rmse_deg


def test_a_rotation_where_an_effect_cannot_be_learned_does_not_keep_it_from_the_others():
    sensors = ("T_MCP", "T_IP", "I_MCP", "I_DIP", "R_MCP", "RP_ABD")
    found = improved(1001, sensors, Cause("creep", "squeezed_fluid", 2.0), max_steps=1)
    assert added(found)[:1] == ["creep"]
    assert found.steps[1].added is not None
    left_out = set(sensors) - set(found.steps[1].added.where)
    assert left_out == {"RP_ABD"}
    assert any("RP_ABD, where it was left out" in item for item in improvement_sentences(found))
    assert found.steps[1].per_rotation["RP_ABD"] <= found.steps[0].per_rotation["RP_ABD"] * 1.001


@pytest.mark.slow
def test_a_lucky_control_does_not_undo_an_effect():
    sensors = ("TI_ABD", "T_MCP", "T_IP", "R_PIP", "P_PIP", "W_FLEX")
    found = improved(1003, sensors, Cause("supply_sag", "regulator_dropout", 2.0))
    assert added(found) == ["supply_sag"]


def test_what_seems_to_explain_a_part_of_a_slip_is_not_added():
    found = improved(
        7, ("I_MCP", "I_PIP", "M_MCP", "M_PIP", "R_MCP"), Cause("garment_slip", "slides_along_finger", 2.0)
    )
    assert added(found) == ["garment_slip"]


@pytest.mark.parametrize(("size_deg", "kept"), [(0.9, False), (1.1, True), (None, True)])
def test_a_finding_is_held_against_what_is_saved_on_its_rotations(size_deg, kept):
    finding = Finding("garment_slip", ("I_PIP",), "it slips", size_deg=size_deg)
    assert is_beside_known(finding, {"I_PIP": 5.0, "I_MCP": 99.0}, 0.2) is kept
