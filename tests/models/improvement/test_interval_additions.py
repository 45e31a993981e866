"""Effects that are recognised, not fitted, as steps: claims become true, faults are left out and told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings, trained_rotations
from glovecal_models.comparison.compare import compare
from glovecal_models.comparison.residuals import residuals
from glovecal_models.effects.saturation.saturated_band import saturated_bands
from glovecal_models.errors import BadInput
from glovecal_models.improvement.add_effect import add_effect
from glovecal_models.improvement.improve import improve
from glovecal_models.improvement.text import addition_sentence, improvement_sentences
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import RecordedSession, record_session
from glovecal_models.simulation.session_plan import SessionPlan

SENSORS = ("I_MCP", "I_PIP", "M_MCP")
LAYOUT = Layout.from_columns("three", SENSORS, SENSORS)
SETTINGS = TrainingSettings(samples=200, folds=3)


def recorded(
    seed: int, *causes: Cause, takes: int = 3, take_s: float = 40.0, rate_hz: float = 60.0
) -> RecordedSession:
    plan = SessionPlan(
        seed=seed,
        sensors=SENSORS,
        wearings=2,
        takes_per_wearing=takes,
        take_s=take_s,
        rate_hz=rate_hz,
        bits=12,
    )
    return record_session(plan, causes)


def trained(session: RecordedSession) -> CalibrationModel:
    return train(session.takes, LAYOUT, "anna", replace(SETTINGS, folds=0))


@pytest.mark.parametrize("size_deg", [1.0, 2.0])
def test_the_interval_at_the_rail_covers_the_truth(size_deg):
    session = recorded(11, Cause("saturation", "hard_clip", size_deg, ("I_PIP",)))
    model = trained(session)
    bands = [band.to_settings() for band in saturated_bands(session.takes, {"I_PIP": "I_PIP"})]
    added = add_effect(
        model, session.takes, "saturation", rotations=["I_PIP"], constants={"bands": bands}, settings=SETTINGS
    )
    assert added.added
    assert "Held-out NLPD" in addition_sentence(added)
    new = [session.also("natural", 40.0, wearing) for wearing in (0, 1, 2)]
    covered = []
    for each in (added.model, model):
        found = residuals(each, [item.take for item in new])
        column, inside = found.column("I_PIP"), []
        for one, item in zip(found.takes, new, strict=True):
            lost = item.take.readings[:, 1] != item.clean.readings[:, 1]
            inside.append((np.abs(one.error) <= 1.96 * one.sd)[lost, column])
        covered.append(np.concatenate(inside).mean())
    assert covered[0] >= 0.9 > covered[1]


def test_a_slip_makes_long_sessions_claim_what_is_true():
    """One walk may happen to stay near its start: the law is asked of the mean over gloves and wearings."""
    nlpd, coverage = [], []
    for seed in (20, 21, 22):
        session = recorded(seed, Cause("garment_slip", "random_walk", 2.0), rate_hz=20.0)
        model = trained(session)
        every = trained_rotations(model)
        added = add_effect(
            model, session.takes, "garment_slip", rotations=every, settings=SETTINGS, parent_id="p"
        )
        assert added.added
        assert added.model.parent == "p"
        assert added.after == added.before, "the angles stay"
        assert added.claim is not None
        assert added.claim.nlpd_after < added.claim.nlpd_before, "on held-out takes"
        assert all(numbers["rate_deg_per_sqrt_min"] > 0 for numbers in added.parameters.values())
        long = [session.also("natural", 300.0, wearing).take for wearing in (2, 3)]
        pair = [compare(each, long).overall for each in (model, load(dump(added.model)))]
        assert pair[0].rmse_deg == pair[1].rmse_deg
        nlpd.append([one.nlpd for one in pair])
        coverage.append([one.coverage for one in pair])
    assert np.diff(np.mean(nlpd, axis=0)) < 0
    before, after = np.abs(np.mean(coverage, axis=0) - 0.68)
    assert after < before


def test_a_claim_that_becomes_no_truer_is_undone_and_few_takes_are_refused():
    session = recorded(5, takes=2, take_s=20.0)
    model = trained(session)
    undone = add_effect(
        model, session.takes, "saturation", rotations=["I_PIP"], constants={"bands": []}, settings=SETTINGS
    )
    assert not undone.added
    assert undone.model is model
    assert "does not become truer" in addition_sentence(undone)
    with pytest.raises(BadInput, match="2 were given, 3 are needed"):
        add_effect(model, session.takes[:2], "garment_slip", rotations=["I_PIP"], settings=SETTINGS)


def test_with_too_few_takes_to_check_a_claim_saturation_is_only_named():
    session = recorded(3, Cause("saturation", "hard_clip", 3.0))
    found = improve(session.takes[:2], LAYOUT, "anna", SETTINGS)
    assert found.diagnosis is not None
    assert found.diagnosis.named is not None
    assert found.diagnosis.named.effect == "saturation"
    assert not any(step.added for step in found.steps)


def test_a_fault_is_left_out_told_and_served_live():
    session = recorded(7, Cause("sensor_fault", "spikes", 2.0, ("I_PIP",)), takes=2, take_s=20.0)
    found = improve(session.takes, LAYOUT, "anna", SETTINGS, max_steps=1)
    added = found.steps[1].added
    assert added is not None
    assert (added.effect, added.where) == ("sensor_fault", ("I_PIP",))
    sentences = improvement_sentences(found)
    assert any("faulty readings" in item and "Live poses hold" in item for item in sentences)
    model = found.steps[1].model
    evidence = model.effects[0].evidence
    assert evidence["live_seen_share"] > 0.8
    assert evidence["live_false_share"] < 0.01
    new = session.also("natural", 40.0, 0)
    comparison = compare(model, [new.take])
    assert 0 < comparison.excluded["I_PIP"] < 0.1 * len(new.take.time_s)
    spiked = np.abs(new.take.readings - new.clean.readings)[:, 1] > 0.05 * np.ptp(new.clean.readings[:, 1])
    errors = []
    for each in (found.steps[0].model, model):
        angles = residuals(each, [replace(new.take, reference=new.take.reference)]).takes[0].predicted
        errors.append(np.sqrt(np.mean((angles - new.truth)[spiked, 1] ** 2)))
    assert errors[1] < 0.4 * errors[0], "the last good angle is nearer than what the spike says"


def test_the_error_of_the_control_is_kept_with_the_effect():
    session = recorded(9, Cause("hysteresis", "single_play", 3.0, ("I_PIP",)), takes=2, take_s=20.0)
    added = add_effect(trained(session), session.takes, "hysteresis", rotations=["I_PIP"], settings=SETTINGS)
    assert added.added
    evidence = added.model.effects[0].evidence
    assert evidence["rmse_after_deg"] < 0.8 * evidence["rmse_control_deg"]
    assert evidence["rmse_control_deg"] <= evidence["rmse_before_deg"]
