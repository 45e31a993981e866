"""The library adds no numbers of its own: its results are those of the functions behind it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import glovecal
from glovecal_models.calibration.artifact import dump, load, model_id
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.comparison.compare import compare
from glovecal_models.comparison.noise_floor import rotation_noise
from glovecal_models.comparison.residuals import residuals
from glovecal_models.comparison.where_it_fails import where_it_fails
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.text import diagnosis_sentences
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.improvement.add_effect import add_effect
from glovecal_models.improvement.improve import improve
from glovecal_models.improvement.remove_effect import remove_effect
from glovecal_models.improvement.text import addition_sentence, improvement_sentences
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.table import read_takes

pytestmark = pytest.mark.usefixtures("one_thread")
SAMPLES = 300
SETTINGS = TrainingSettings(samples=SAMPLES)


def same(ours, theirs) -> bool:
    return repr(ours.to_document()) == repr(theirs.to_document())


def alike(ours, theirs) -> bool:
    """But for what was asked about, which only the library's caller knows."""
    asked = {"subject", "model", "method", "title", "takes", "simulated"}
    first, second = (
        {name: value for name, value in vars(one).items() if name not in asked} for one in (ours, theirs)
    )
    return repr(first) == repr(second)


def test_simulate(session):
    plan = SessionPlan(seed=5, sensors=("I_MCP", "I_PIP"), wearings=3, takes_per_wearing=3, take_s=20.0)
    there = record_session(plan, [Cause("hysteresis", strength_deg=3.0, channels=("I_PIP",))])
    for ours, theirs in zip(session.takes, there.takes, strict=True):
        assert np.array_equal(ours.readings, theirs.readings)
        assert np.array_equal(ours.reference, theirs.reference)
    assert all(take.simulated for take in session.takes)
    assert (session.hidden, session.hidden_on) == ("hysteresis", ("I_PIP",))


def test_a_whole_glove_is_simulated_with_its_layout():
    session = glovecal.simulate(None, layout="cyberglove18", wearings=1, takes_per_wearing=1, take_s=5.0)
    assert session.layout == glovecal.Layout.built_in("cyberglove18")
    assert session.takes[0].sensors == session.layout.sensors
    assert session.hidden is None


def test_read_takes(takes, tmp_path: Path):
    [file] = glovecal.write_takes(takes, str(tmp_path / "all.csv"))
    ours, theirs = glovecal.read_takes(str(file)), read_takes(file)
    assert [item.name for item in ours] == [item.name for item in theirs]
    assert all(np.array_equal(a.readings, b.readings) for a, b in zip(ours, theirs, strict=True))
    assert glovecal.read_takes(file, file).table().rows == (*ours.table().rows, *ours.table().rows)


def test_train(model, session, takes):
    layout = glovecal.Layout.from_columns("columns", session.layout.sensors, session.layout.rotations)
    theirs = train(takes, layout, "anna", SETTINGS)
    assert dump(model.inner) == dump(theirs)
    assert model.held_out_rmse_deg == theirs.error_estimate["rmse_deg"]


def test_compare_and_where(model, takes):
    assert alike(glovecal.compare(model, takes), compare(model.inner, takes))
    theirs = where_it_fails(residuals(model.inner, takes), seed=3)
    assert alike(glovecal.where(model, takes, seed=3), theirs)


def test_fingertips_of_a_whole_glove():
    session = glovecal.simulate(None, layout="cyberglove18", wearings=1, takes_per_wearing=2, take_s=10.0)
    model = glovecal.train(session.takes, layout=session.layout, method="linear", folds=0)
    ours = glovecal.compare(model, session.takes, hand_length_mm=180.0)
    hand = HandDimensions.from_measured({"hand_length": 180.0})
    assert alike(ours, compare(model.inner, session.takes, dimensions=hand))
    assert ours.fingertip_rmse_mm is not None
    assert "mm (RMSE, for a hand of 180 mm" in str(ours)
    with pytest.raises(glovecal.BadInput):
        glovecal.compare(model, session.takes, hand_length_mm=18.0)


def test_diagnose(diagnosis, model, takes):
    noise = rotation_noise(residuals(model.inner, takes))
    floors = {name: item.floor for name, item in noise.items() if item.floor is not None}
    theirs = diagnose(takes, model.layout, noise_floors=floors)
    ours = diagnosis.inner
    assert [item.rmse_deg for item in ours.assessments] == [item.rmse_deg for item in theirs.assessments]
    assert diagnosis_sentences(ours) == diagnosis_sentences(theirs)
    assert (diagnosis.effect, diagnosis.rotations) == ("hysteresis", ("I_PIP",))
    assert diagnosis.confidence_set == ("hysteresis",)
    assert "contact_pressure" in diagnosis.not_identifiable


def test_add_and_remove(addition, model, takes):
    theirs = add_effect(
        model.inner, takes, "hysteresis", rotations=("I_PIP",), settings=SETTINGS, parent_id=model.id
    )
    assert (addition.inner.before, addition.inner.after) == (theirs.before, theirs.after)
    assert addition.sentence == addition_sentence(theirs)
    assert dump(addition.model.inner) == dump(theirs.model)
    assert addition.added
    assert (addition.model.parent, addition.model.effects) == (model.id, ("hysteresis",))
    ours = glovecal.remove_effect(addition.model, takes, "hysteresis", samples=SAMPLES)
    without = remove_effect(
        addition.model.inner, takes, "hysteresis", settings=SETTINGS, parent_id=addition.model.id
    )
    assert dump(ours.inner) == dump(without)
    assert ours.effects == ()


def test_improve(improvement, model, takes):
    theirs = improve(takes, model.layout, "anna", SETTINGS, max_steps=1)
    assert list(improvement.sentences) == improvement_sentences(theirs)
    assert [dump(item.inner) for item in improvement.models] == [dump(item) for item in theirs.models]
    assert improvement.effects == ("hysteresis",)
    assert improvement.rmse_deg[1] < 0.7 * improvement.rmse_deg[0]


def test_predict(addition, takes):
    model, take = addition.model, takes[0]
    predictor = GlovePredictor(model.inner)
    ours = glovecal.predict(model, take)
    theirs = predictor.predict_take(take.time_s, take.readings, take.context, take.wearing)
    assert np.array_equal(ours.mean_deg, theirs.mean)
    assert np.array_equal(ours.sd_deg, theirs.sd)
    assert np.array_equal(ours.flags, theirs.flags)
    alone = glovecal.predict(model, take.readings)
    assert np.array_equal(alone.mean_deg, predictor.predict(take.readings).mean)


def test_save_and_load(addition, tmp_path: Path):
    file = tmp_path / "anna.safetensors"
    name = glovecal.save_model(addition.model, file)
    assert name == addition.model.id == model_id(file.read_bytes())
    assert list(tmp_path.iterdir()) == [file], "nothing unfinished stays behind"
    again = glovecal.load_model(str(file), sha256=name)
    assert again.id == name
    assert dump(load(file.read_bytes())) == dump(again.inner)
