"""Of sensors that nobody assigned, those that tell a rotation are read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from foreign_tables import takes as foreign_takes

from glovecal_models.calibration.training_plan import plan_training, with_chosen_inputs
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

PINS = tuple(f"A{number}" for number in range(5))
JOINTS = tuple(f"joint{number}" for number in range(5))


def recorded(order: tuple[int, ...], count: int = 6, seconds: float = 10.0) -> list[Take]:
    """Takes of a glove whose sensors are wired to its pins in ``order``; each feels its neighbour too."""
    return [
        Take(name, wearing, PINS, time_s, readings[:, order], JOINTS, time_s, angles)
        for name, wearing, time_s, readings, angles in foreign_takes(count, seconds=seconds)
    ]


@pytest.mark.parametrize("order", [(0, 1, 2, 3, 4), (3, 0, 4, 1, 2)])
def test_the_sensor_of_each_rotation_is_among_few_whatever_their_numbers_say(order: tuple[int, ...]) -> None:
    layout = Layout.from_columns("any", PINS, JOINTS)
    chosen = plan_training(recorded(order), layout, "any").layout
    for number, item in enumerate(chosen.correspondences):
        assert PINS[order.index(number)] in item.sensors
        assert len(item.sensors) <= 3
    assert chosen.sensors == layout.sensors


def test_the_same_takes_give_the_same_sensors_and_what_was_said_stays() -> None:
    takes = recorded((0, 1, 2, 3, 4))
    layout = Layout.from_columns("any", PINS, JOINTS)
    once = plan_training(takes, layout, "any").layout
    assert plan_training(takes, once, "any").layout == once
    said = Layout.from_document(
        {"name": "said", "sensors": list(PINS), "rotations": {name: list(PINS[:4]) for name in JOINTS}}
    )
    assert plan_training(takes, said, "any").layout is said


def test_few_samples_choose_nothing() -> None:
    layout = Layout.from_columns("any", PINS, JOINTS)
    [take] = recorded((0, 1, 2, 3, 4), 1, 4.0)
    sparse = np.full_like(take.reference, np.nan)
    sparse[::2] = take.reference[::2]
    assert with_chosen_inputs(layout, JOINTS, [replace(take, reference=sparse)]) is layout
