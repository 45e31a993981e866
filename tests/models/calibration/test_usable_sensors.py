"""One dead sensor of many does not stop training: it is left out, told, and the glove goes on sending it."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.text import plan_sentences
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_plan import plan_training, usable_sensors
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.comparison.residuals import residuals
from glovecal_models.errors import NotTrainable
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import check_take

SENSORS = tuple(f"S{number:02d}" for number in range(61))
LINEAR = TrainingSettings(method="linear", folds=2)


def recorded(seed: int = 0, **columns: np.ndarray) -> Take:
    """A bend read by 61 sensors, 600 frames at 60 Hz; ``columns`` replaces what some sensors read."""
    random = np.random.default_rng(seed)
    time = np.arange(600) / 60.0
    angle = 45 + 40 * np.sin(time + seed)
    readings = np.round(angle[:, None] * random.uniform(0.5, 2, 61) + random.normal(size=(600, 61)))
    for name, values in columns.items():
        readings[:, SENSORS.index(name)] = values
    return Take(f"t{seed}", "w", SENSORS, time, readings, ("BEND",), time, angle[:, None])


def faulty(seed: int = 0) -> Take:
    clipped = np.where(np.arange(600) % 10 == 0, 250.0, 255.0)
    one_count = 7.0 + (np.arange(600) % 50 == 0)
    return recorded(seed, S08=np.full(600, 121.0), S16=one_count, S30=clipped)


def test_dead_and_clipped_sensors_are_left_out_and_told():
    takes = [faulty(0), faulty(1)]
    layout = Layout.from_columns("many", SENSORS, ["BEND"])
    plan = plan_training(takes, layout, "anna", LINEAR)
    assert (
        "Dead sensors in these takes: S08 (always 121), S16 (only 7 or 8), S30 (at its end stop 255 in 90 % "
        "of the frames). Not used in training; rotations are read from the others. Is a wire broken?"
    ) in plan_sentences(plan)
    model = load(dump(train(takes, layout, "anna", LINEAR)))
    assert model.layout.sensors == SENSORS, "the glove still sends all of them"
    assert len(model.rotations[0].correspondence.sensors) == 58
    error = residuals(model, [recorded(2, S08=np.full(600, 300.0))]).takes[0].error[:, 0]
    assert np.sqrt(np.mean(error**2)) < 60, "whatever a dead sensor reads later"


def test_keeping_dead_sensors_refuses_them_without_a_list_of_all_others():
    layout = Layout.from_columns("many", SENSORS, ["BEND"])
    with pytest.raises(NotTrainable, match="sensor S08 reads 121 in all 1200 samples") as refused:
        plan_training([faulty(0), faulty(1)], layout, "anna", TrainingSettings("linear", keep_dead=True))
    assert "name the others (60 of them)" in str(refused.value)


def test_a_rotation_without_its_own_sensor_is_left_out_of_the_model():
    names = ("A", "B")
    time = np.arange(400) / 50.0
    moves = np.column_stack([40 + 30 * np.sin(time), 40 + 30 * np.cos(time)])
    readings = np.column_stack([np.full(400, 9.0), 2 * moves[:, 1]])
    take = Take("t", "w", names, time, readings, names, time, moves)
    layout = Layout.from_toml(
        'name = "two"\nsensors = ["A", "B"]\n[rotations]\nA = ["A", "B"]\nB = ["B", "A"]'
    )
    plan = plan_training([take], layout, "anna", LINEAR)
    assert list(plan.correspondences) == ["B"]
    assert "No working sensor measures A: not in the model." in plan_sentences(plan)
    nothing = Layout.from_toml('name = "one"\nsensors = ["A", "B"]\n[rotations]\nA = ["A"]')
    with pytest.raises(
        NotTrainable, match=r"no working sensor measures A; dead in these takes: A \(always 9\)"
    ):
        plan_training([take], nothing, "anna", LINEAR)


def test_a_sensor_that_rests_at_its_end_with_its_joint_is_not_clipped():
    """Fingers are straight most of the time; a sensor that stays there while its joint bends is clipped."""
    time = np.arange(600) / 60.0
    bent = np.where(np.arange(600) < 60, np.arange(600), 0.0)
    other = np.round(100 + 50 * np.sin(time))
    layout = Layout.from_columns("two", ["A", "B"], ["A", "B"])
    for angle, expected in ((bent, []), (other, ["A"])):
        reference = np.column_stack([angle, other])
        take = Take("t", "w", ("A", "B"), time, np.column_stack([bent, other]), ("A", "B"), time, reference)
        assert [item.sensor for item in usable_sensors(layout, [take]).dead] == expected


def test_the_check_of_a_take_names_them():
    (sentence,) = check_take(faulty()).sentences
    assert sentence == (
        "Take 't0': sensors that say nothing of the hand: S08 (always 121), S16 (only 7 or 8), S30 (at its"
        " end stop 255 in 90 % of the frames). Is a wire broken?"
    )
