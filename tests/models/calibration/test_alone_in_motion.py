"""The only take of its motion is left out in pieces that know what came before them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.calibration.added_effect import EffectRequest
from glovecal_models.calibration.effect_fit import fit_with_effects
from glovecal_models.calibration.folds import alone_in_their_motion
from glovecal_models.calibration.leave_out import _cut, frame_errors_of, held_out_errors
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.effects.catalogue import effect
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take

SENSORS = ("I_PIP", "M_PIP")
SETTINGS = TrainingSettings(folds=2, samples=150)
CREEP = [EffectRequest(effect("creep"), SENSORS)]
FREE = ("w1-t1", "w1-t2", "w1-t3", "w1-t4")


@pytest.fixture(scope="module")
def takes() -> list[Take]:
    """Four takes of free motion and one of slow ramps, with creep."""
    plan = SessionPlan(
        seed=6, sensors=SENSORS, wearings=1, takes_per_wearing=5, take_s=25.0,
        motions=("natural", "natural", "natural", "natural", "ramps"),
    )  # fmt: skip
    return list(record_session(plan, (Cause("creep", "two_exponentials", 2.0),)).takes)


def prepared(takes: list[Take], last: str) -> PreparedTakes:
    named = [replace(take, name=name) for take, name in zip(takes, (*FREE, last), strict=True)]
    return PreparedTakes.of(named, Layout.from_columns("two", SENSORS, SENSORS))


@pytest.mark.parametrize(
    ("names", "alone"),
    [
        (["w1-t1", "w1-t2", "w1-ramps-1"], [False, False, True]),
        (["w1-t1", "w1-ramps-1"], [False, False]),
        (["fist", "flat", "ok"], [False, False, False]),
        (["walk-1", "walk-2", "walk-3", "stairs", "hop"], [False, False, False, True, True]),
        ([], []),
    ],
)
def test_a_take_is_alone_beside_many_of_another_motion(names, alone):
    assert alone_in_their_motion(names, ["w1"] * len(names)) == alone


def test_pieces_with_their_history_are_predicted_as_the_whole_take_is(takes):
    """The same errors to the last digit, and each measured frame once: stream equals batch."""
    whole = prepared(takes, "w1-ramps-1")
    fit = fit_with_effects(whole, SENSORS, CREEP, SETTINGS)
    parts, owner, place = _cut(whole, [False] * 4 + [True], with_history=True)
    assert owner.tolist() == [0, 1, 2, 3, 4, 4, 4, 4]
    assert place.tolist() == [0, 0, 0, 0, 0, 1, 2, 3]
    errors = frame_errors_of(fit, parts, SENSORS, SETTINGS)
    known = [part[np.isfinite(part).all(axis=1)] for part in errors[4:]]
    expected = frame_errors_of(fit, whole, SENSORS, SETTINGS)[4]
    assert np.concatenate(known) == pytest.approx(expected[np.isfinite(expected).all(axis=1)], abs=1e-9)


def test_a_right_effect_saves_error_with_the_take_that_decides(takes):
    alone, whole = prepared(takes, "w1-ramps-1"), prepared(takes, "w1-t5")
    left = {
        kind: [
            held_out_errors(part, SENSORS, wanted, SETTINGS).overall_deg for wanted in ((), CREEP)
        ]
        for kind, part in (("alone", alone), ("whole", whole))
    }  # fmt: skip
    assert left["alone"][1] < 0.9 * left["alone"][0]
    assert left["alone"][1] < left["whole"][1]


@pytest.mark.parametrize("frames", [1, 2, 3, 7])
def test_a_take_of_few_frames_that_is_alone_breaks_nothing(takes, frames):
    last = takes[-1]
    until = last.time_s[frames - 1]
    known = last.reference_time_s <= until
    cut = replace(
        last, time_s=last.time_s[:frames], readings=last.readings[:frames],
        reference_time_s=last.reference_time_s[known], reference=last.reference[known],
        context={name: values[:frames] for name, values in last.context.items()},
    )  # fmt: skip
    found = held_out_errors(prepared([*takes[:4], cut], "w1-ramps-1"), SENSORS, (), SETTINGS)
    whole = held_out_errors(prepared([*takes[:4], cut], "w1-t5"), SENSORS, (), SETTINGS)
    assert found.count == whole.count
