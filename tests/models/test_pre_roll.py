"""Frames before the reference: they set memories up, and nothing else is learned, judged or counted there."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glovecal_models.calibration.folds import first_measured, pieces
from glovecal_models.calibration.samples import gather_samples
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.comparison.dependence import covariates
from glovecal_models.comparison.residuals import residuals
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.resampled import resampled
from glovecal_models.effects.delay.clock_offset import offset_to
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.clock_scan import clock_offsets
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import check_take
from glovecal_models.takes.write_table import write_takes

SENSORS = ("I_MCP", "I_PIP")
LAYOUT = Layout.from_columns("two", SENSORS, SENSORS)
LEAD_S = 30.0


def session(*causes: Cause, seed: int = 12, clock: str = "same") -> tuple[Take, ...]:
    plan = SessionPlan(
        seed=seed, sensors=SENSORS, wearings=3, takes_per_wearing=3, take_s=LEAD_S + 20.0,
        reference_clock="own" if clock == "own" else "same",
    )  # fmt: skip
    return record_session(plan, causes).takes


def with_pre_roll(take: Take) -> Take:
    """Its first part as a pre-roll; the reference that was measured there stays in the table."""
    return replace(take, begins_s=float(take.time_s[0]) + LEAD_S)


def without_pre_roll(take: Take) -> Take:
    """Only the part after it."""
    start = float(take.time_s[0]) + LEAD_S
    kept, rows = take.time_s >= start, take.reference_time_s >= start
    return replace(
        take,
        time_s=take.time_s[kept],
        readings=take.readings[kept],
        reference_time_s=take.reference_time_s[rows],
        reference=take.reference[rows],
        context={name: values[kept] for name, values in take.context.items()},
        poses=None if take.poses is None else tuple(np.array(take.poses, dtype=object)[kept].tolist()),
    )


@pytest.fixture(scope="module")
def clean() -> tuple[Take, ...]:
    return session()


@pytest.fixture(scope="module")
def creeping() -> tuple[Take, ...]:
    return session(Cause("creep", "one_exponential", strength_deg=1.5))


@pytest.mark.parametrize("clock", ["same", "own"])
def test_no_reference_is_read_there(clock):
    take = with_pre_roll(session(clock=clock)[0])
    known = np.all(np.isfinite(take.reference_at_frames(take.rotations)), axis=1)
    assert not known[: take.pre_roll_frames].any()
    assert known[take.pre_roll_frames :].mean() > 0.99
    even = resampled(take, SENSORS, SENSORS)
    assert not np.isfinite(even.reference[even.time_s < take.start_s]).any()
    assert np.isfinite(even.readings[even.time_s < take.start_s]).all()


def test_samples_and_regressors_are_those_of_the_part_after_it(clean):
    lead, bare = [with_pre_roll(t) for t in clean], [without_pre_roll(t) for t in clean]
    item = LAYOUT.correspondence("I_PIP")
    np.testing.assert_array_equal(gather_samples(lead, item).target, gather_samples(bare, item).target)
    settings = TrainingSettings(method="linear", folds=0)
    models = [train(takes, LAYOUT, "anna", settings) for takes in (lead, bare)]
    errors = [residuals(model, takes) for model, takes in zip(models, (lead, bare), strict=True)]
    known = np.isfinite(errors[0].stacked("error"))
    np.testing.assert_allclose(errors[0].stacked("error")[known], errors[1].stacked("error").ravel())


def test_the_time_in_a_take_counts_from_the_request_on(clean):
    lead = [with_pre_roll(t) for t in clean[:1]]
    found = residuals(train(lead, LAYOUT, "anna", TrainingSettings(method="linear", folds=0)), lead)
    (since,) = (each.values[0] for each in covariates(found, "I_MCP") if each.name == "time in take")
    assert since[0] == pytest.approx(-LEAD_S)
    assert since[-1] == pytest.approx(20.0, abs=0.1)


def test_an_examination_does_not_ask_for_a_reference_there(clean):
    found = check_take(with_pre_roll(clean[0]))
    assert found.frames_with_reference == 1.0
    assert found.pre_roll_s == pytest.approx(LEAD_S)
    assert found.pre_roll_frames == pytest.approx(60 * LEAD_S, abs=2)
    assert found.sentences == ()
    assert check_take(clean[0]).pre_roll_frames == 0


@pytest.mark.parametrize("clock", ["same", "own"])
def test_a_table_of_it_holds_the_frames_and_no_reference(clock, tmp_path: Path):
    take = with_pre_roll(session(clock=clock)[0])
    (back,) = read_takes(*write_takes([take], tmp_path / "take.csv"))
    np.testing.assert_array_equal(back.readings, take.readings)
    same = [np.isfinite(each.reference_at_frames(SENSORS)).sum() for each in (back, take)]
    assert same[0] == pytest.approx(same[1], abs=2 * len(SENSORS))
    assert not np.isfinite(back.reference_at_frames(SENSORS)[: take.pre_roll_frames]).any()


@pytest.mark.parametrize("marked", [True, False], ids=["pre-roll", "a table whose frames begin earlier"])
def test_clocks_are_judged_though_most_frames_have_no_reference(clean, marked):
    late = []
    for take in clean[:3]:
        rows = take.reference_time_s >= take.time_s[0] + LEAD_S
        late.append(
            replace(
                take,
                reference_time_s=take.reference_time_s[rows] + 0.7,
                reference=take.reference[rows],
                begins_s=with_pre_roll(take).begins_s if marked else None,
            )
        )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = clock_offsets(late)
    assert [item.verdict for item in found] == ["offset"] * 3
    assert [item.offset_s for item in found] == pytest.approx([0.7] * 3, abs=0.03)
    at_frames = clean[0].reference_at_frames(SENSORS)
    assert offset_to(late[0], SENSORS, at_frames, 3.0) == pytest.approx(0.7, abs=0.03)


def test_quarters_and_levels_are_cut_from_what_was_measured():
    motion = np.concatenate([np.full(300, np.nan), np.linspace(0, 90, 100)])[:, None]
    assert first_measured(motion) == 300
    assert pieces(np.arange(400.0), motion) == [
        slice(0, 325), slice(325, 350), slice(350, 375), slice(375, 400)
    ]  # fmt: skip
    levels = np.concatenate([np.full(300, np.nan), np.repeat([0.0, 10.0, 20.0, 30.0], 20)])[:, None]
    assert pieces(np.arange(380.0), levels) == [
        slice(0, 320), slice(320, 340), slice(340, 360), slice(360, 380)
    ]  # fmt: skip


def test_what_went_before_tells_creep_where_it_stands(creeping):
    """The hand's way before the reference is read from the sensors: more of the creep is explained."""
    named = {}
    for name, cut in (("bare", without_pre_roll), ("lead", with_pre_roll)):
        found = diagnose([cut(take) for take in creeping], LAYOUT).named
        assert found is not None
        assert found.confidence_set == ("creep",), name
        named[name] = found.saved_deg
    assert named["lead"] > 1.2 * named["bare"]


def test_a_clean_glove_with_it_is_left_alone(clean):
    assert diagnose([with_pre_roll(take) for take in clean], LAYOUT).named is None
