"""The black-box ceiling: none on a clean glove, gain where an effect is hidden, undecided on few takes."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.ceiling.black_box import left_by_box
from glovecal_models.ceiling.black_box_ceiling import black_box_ceiling
from glovecal_models.ceiling.ceiling import CEILING_LIMITS, Gain, sign_flip_p_value, verdict_of
from glovecal_models.ceiling.text import ceiling_sentence, not_left_to_gain
from glovecal_models.errors import Cancelled
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take

SENSORS = ("I_MCP", "I_PIP")


def session(*causes: Cause) -> tuple[list[Take], CalibrationModel]:
    plan = SessionPlan(
        seed=5, sensors=SENSORS, bits=12, nuisance="white", wearings=2, takes_per_wearing=4, take_s=25.0
    )
    takes = list(record_session(plan, causes).takes)
    layout = Layout.from_document(
        {"name": "two", "sensors": list(SENSORS), "rotations": {name: [name] for name in SENSORS}}
    )
    return takes, train(takes, layout, "simulated", TrainingSettings(folds=0, samples=300))


def test_nothing_is_left_to_gain_on_a_clean_glove() -> None:
    takes, model = session()
    found = black_box_ceiling(model, takes)
    assert found.verdict == "none"
    assert found.overall is not None
    assert found.overall.high_share < CEILING_LIMITS.none_below
    assert ceiling_sentence(found).startswith("Nothing is left to gain")
    assert 0.5 < found.overall.offline_deg / found.overall.rmse_deg < 0.95
    assert f"both directions of time, {found.overall.offline_deg:.2f} degrees" in ceiling_sentence(found)
    assert not_left_to_gain(found)


def test_an_unmodelled_lag_is_left_to_gain_from_the_history_and_the_answer_repeats() -> None:
    takes, model = session(Cause("lag", "one_pole", 1.5))
    found = black_box_ceiling(model, takes, seed=1)
    assert found.verdict == "gain"
    assert found.overall is not None
    assert found.overall.ceiling_deg < 0.85 * found.overall.rmse_deg
    assert next(iter(found.groups)) == "history"
    assert set(found.gaining) == set(SENSORS)
    assert black_box_ceiling(model, takes, seed=1) == found
    assert not not_left_to_gain(found)


def test_few_takes_are_undecided_and_a_cancel_stops_it() -> None:
    takes, model = session()
    found = black_box_ceiling(model, takes[:4])
    assert found.verdict == "undecided"
    assert "4 takes were measured, 6 are needed" in ceiling_sentence(found)
    with pytest.raises(Cancelled):
        black_box_ceiling(model, takes, cancelled=lambda: True)


def test_a_column_of_which_nothing_is_known_changes_nothing() -> None:
    random = np.random.default_rng(3)
    take = np.repeat(np.arange(8), 100)
    columns = random.standard_normal((800, 3))
    target = np.sin(2 * columns[:, 0]) + 0.3 * random.standard_normal(800)
    unknown = np.column_stack([columns, np.full(800, np.nan)])
    assert left_by_box(unknown, target, take, 1).square.sum() == pytest.approx(
        left_by_box(columns, target, take, 1).square.sum(), rel=0.1
    )


def test_products_find_a_memory_that_depends_on_the_bend_and_nothing_in_noise() -> None:
    random = np.random.default_rng(5)
    take = np.repeat(np.arange(8), 200)
    reading, average = random.standard_normal((2, len(take)))
    noise = random.standard_normal(len(take))
    columns = np.column_stack([reading, average, random.standard_normal((len(take), 12))])
    products = [(0, 0), (0, 1), (0, 0, 1)]
    memory = average * (1 + reading) + noise
    by_trees = left_by_box(columns, memory, take, 1).square.sum()
    with_products = left_by_box(columns, memory, take, 1, products=products).square.sum()
    assert with_products < 1.1 * (noise @ noise) < 0.95 * by_trees
    assert left_by_box(columns, noise, take, 1, products=products).square.sum() == pytest.approx(
        noise @ noise, rel=0.01
    )


def test_flipping_signs_of_whole_takes() -> None:
    assert sign_flip_p_value(np.ones(6), 0) == pytest.approx(1 / 64)
    assert sign_flip_p_value(np.tile([1.0, -1.0], 10), 0) > 0.4
    assert sign_flip_p_value(np.ones(20), 0) < 1e-3


def test_the_verdict_follows_the_interval() -> None:
    wide, one = np.array([3.0, -3.0] * 4), np.full(8, 0.5)
    steady, nothing = Gain.of(one, 1.0, 1.0, 0), Gain.of(0.001 * wide, 1.0, 1.0, 0)
    assert verdict_of(steady, {"a": steady}, CEILING_LIMITS) == "gain"
    assert verdict_of(nothing, {"a": nothing}, CEILING_LIMITS) == "none"
    assert verdict_of(nothing, {"a": nothing, "b": steady}, CEILING_LIMITS) == "gain"
    unsure = Gain.of(wide, 1.0, 1.0, 0)
    assert verdict_of(unsure, {"a": unsure}, CEILING_LIMITS) == "undecided"
