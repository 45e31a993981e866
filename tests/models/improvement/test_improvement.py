"""Adding an effect, proving it, undoing it, taking it out; and the whole walk."""

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings, requested_effects
from glovecal_models.comparison.residuals import residuals
from glovecal_models.errors import BadInput, Cancelled
from glovecal_models.improvement.add_effect import add_effect
from glovecal_models.improvement.answer import falls_of
from glovecal_models.improvement.fall.answer import FallStep
from glovecal_models.improvement.improve import improve
from glovecal_models.improvement.remove_effect import remove_effect
from glovecal_models.improvement.text import addition_sentence, improvement_sentences
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import RecordedSession, record_session
from glovecal_models.simulation.session_plan import SessionPlan

SENSORS = ("I_MCP", "I_PIP")
LAYOUT = Layout.from_columns("two", SENSORS, SENSORS)
SETTINGS = TrainingSettings(samples=400, folds=3)


def recorded(seed: int, *causes: Cause) -> RecordedSession:
    plan = SessionPlan(seed=seed, sensors=SENSORS, wearings=3, takes_per_wearing=3, take_s=20.0)
    return record_session(plan, causes)


@pytest.fixture(scope="module")
def sticky() -> RecordedSession:
    return recorded(5, Cause("hysteresis", "single_play", strength_deg=3.0, channels=("I_PIP",)))


@pytest.fixture(scope="module")
def parent(sticky) -> CalibrationModel:
    return train(sticky.takes, LAYOUT, "anna", replace(SETTINGS, folds=0))


@pytest.fixture(scope="module")
def added(sticky, parent):
    return add_effect(
        parent, sticky.takes, "hysteresis", rotations=["I_PIP"], settings=SETTINGS, parent_id="p"
    )


def test_an_effect_that_helps_makes_a_child(added, parent):
    assert added.added
    assert added.after.rmse_deg("I_PIP") < 0.65 * added.before.rmse_deg("I_PIP")
    assert added.model.parent == "p"
    assert [item.name for item in added.model.effects] == ["hysteresis"]
    assert added.parameters["I_PIP"]["widest_play_deg"] > 0
    assert parent.effects == (), "the parent is immutable"


def test_a_childs_error_is_of_all_rotations_wherever_the_effect_is(sticky, added):
    assert "rmse_deg" not in added.model.error_estimate, "the parent's other rotations were not measured"
    whole = train(sticky.takes, LAYOUT, "anna", SETTINGS)
    child = add_effect(whole, sticky.takes, "hysteresis", rotations=["I_PIP"], settings=SETTINGS)
    assert child.of_all_deg is not None
    parent_deg, child_deg = child.of_all_deg
    assert parent_deg == whole.error_estimate["rmse_deg"]
    assert child_deg == child.model.error_estimate["rmse_deg"]
    errors = [each.held_out_rmse_deg or np.nan for each in child.model.rotations]
    assert child_deg == pytest.approx(np.sqrt(np.mean(np.square(errors))), rel=0.02)
    assert child_deg < child.after.rmse_deg("I_PIP")


def test_the_child_survives_being_stored(added, sticky):
    artifact = dump(added.model)
    again = load(artifact)
    assert dump(again) == artifact
    take = sticky.takes[0]
    before, after = (residuals(model, [take]).stacked("predicted") for model in (added.model, again))
    assert np.array_equal(before, after)


def test_an_effect_that_does_not_help_is_undone(parent, sticky):
    undone = add_effect(parent, sticky.takes, "lag", rotations=["I_MCP"], settings=SETTINGS)
    assert not undone.added
    assert undone.model is parent
    assert "was undone" in addition_sentence(undone)


def test_an_effect_comes_out_again(added, sticky, parent):
    without = remove_effect(added.model, sticky.takes, "hysteresis", settings=SETTINGS)
    assert without.effects == ()
    take = sticky.takes[:1]
    assert residuals(without, take).stacked("predicted") == pytest.approx(
        residuals(parent, take).stacked("predicted"), abs=0.05
    )
    with pytest.raises(BadInput, match="has no effect 'creep'; it has hysteresis"):
        remove_effect(added.model, sticky.takes, "creep", settings=SETTINGS)


def test_what_cannot_be_learned_is_refused(parent, sticky):
    with pytest.raises(BadInput, match="no effect 'magic'; there are"):
        add_effect(parent, sticky.takes, "magic", settings=SETTINGS)
    with pytest.raises(BadInput, match="no rotation 'T_IP' is trained"):
        add_effect(parent, sticky.takes, "lag", rotations=["T_IP"], settings=SETTINGS)
    with pytest.raises(BadInput, match=r"contact_pressure.*no context column c.contact_n"):
        add_effect(parent, sticky.takes, "contact_pressure", settings=SETTINGS)
    with pytest.raises(Cancelled):
        add_effect(parent, sticky.takes, "hysteresis", settings=SETTINGS, cancelled=lambda: True)


def test_clocks_are_estimated_again_on_other_takes(sticky):
    offsets = dict(zip((take.name for take in sticky.clean), (0.4, -0.7, 0.55) * 3, strict=True))
    takes = [
        replace(take, reference_time_s=take.reference_time_s + offsets[take.name]) for take in sticky.clean
    ]
    found = improve(takes[:6], LAYOUT, "anna", SETTINGS, holdout=takes[6:], max_steps=1)
    step = found.steps[1]
    assert step.added is not None
    assert step.added.effect == "clock_offset"
    for take in takes[:6]:
        assert step.added.parameters["offset_s"][take.name] == pytest.approx(offsets[take.name], abs=0.03)
    assert step.rmse_deg < 1.2
    assert found.steps[0].rmse_deg > 8 * step.rmse_deg


def test_the_loop_adds_the_effect_that_was_simulated(sticky):
    takes, holdout = sticky.takes[:6], sticky.takes[6:]
    told: list[list[FallStep]] = []
    found = improve(
        takes, LAYOUT, "anna", SETTINGS, holdout=holdout, max_steps=2,
        stepped=lambda steps: told.append(falls_of(SETTINGS.method, steps)),
    )  # fmt: skip
    assert [len(falls) for falls in told] == [*range(1, len(found.steps) + 1)]
    assert [fall.rmse_deg for fall in told[-1]] == [step.rmse_deg for step in found.steps]
    first, second = found.steps[:2]
    assert first.added is None
    assert second.added is not None
    assert (second.added.effect, second.added.where) == ("hysteresis", ("I_PIP",))
    assert second.added.verdict in ("named", "ambiguous")
    assert "hysteresis" in second.added.confidence_set
    assert second.rmse_deg < 0.75 * first.rmse_deg
    assert set(first.per_rotation) == set(SENSORS)
    assert found.stopped in ("noise_floor", "nothing_named", "ambiguous", "not_better")
    assert found.trials[0].addition.effect == "hysteresis"
    assert any(
        sentence.startswith("hysteresis on I_PIP reduces") for sentence in improvement_sentences(found)
    )
    assert [item.name for item in requested_effects(found.steps[1].model)] == ["hysteresis"]


def test_a_clean_glove_is_not_improved(sticky):
    found = improve(sticky.clean, LAYOUT, "anna", SETTINGS, max_steps=2)
    assert [step.added for step in found.steps] == [None]
