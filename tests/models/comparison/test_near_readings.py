"""The floor of single poses: how far the reference differs where the readings hardly do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from glovecal_models.calibration.text import dead_sensor_sentences
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_plan import usable_sensors
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.comparison.noise_floor import rotation_noise
from glovecal_models.comparison.residuals import Residuals, residuals
from glovecal_models.layout import Layout
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take

DATA = Path(__file__).parents[4] / "shared" / "data" / "cyberglove-robot-thumb"


def poses(noise_deg: float, seed: int = 0) -> Take:
    """300 poses set by hand, a second apart, each matched to ``noise_deg``."""
    random = np.random.default_rng(seed)
    angle = random.uniform(0, 80, 300)
    readings = np.column_stack([angle + 20, 2 * angle + 0.01 * angle**2])
    reference = (angle + noise_deg * random.normal(size=300))[:, None]
    time = np.arange(300.0)
    return Take("poses", "w", ("A", "B"), time, readings, ("BEND",), time.copy(), reference)


def fitted(takes: list[Take], layout: Layout) -> Residuals:
    return residuals(train(takes, layout, "s", TrainingSettings(method="linear", folds=0)), takes)


@pytest.mark.parametrize("noise", [1.0, 6.0])
def test_the_spread_of_like_poses_is_found(noise):
    found = rotation_noise(fitted([poses(noise)], Layout.from_columns("x", "AB", ["BEND"])))
    floor = found["BEND"].floor
    assert floor is not None
    assert floor.how == "near readings"
    assert floor.low_deg < noise < floor.high_deg
    assert floor.floor_deg == pytest.approx(noise, rel=0.2)


@pytest.mark.needs_shared_data
def test_a_robot_thumb_repeats_only_to_about_six_degrees():
    takes = [take for path in sorted(DATA.glob("*.csv")) for take in read_takes(path)]
    layout = Layout.from_columns("thumb", takes[0].sensors, takes[0].rotations)
    usable = usable_sensors(layout, takes)
    assert [item.sensor for item in usable.dead] == ["G08", "G15", "G16"]
    assert dead_sensor_sentences(usable, layout.rotations)[0].startswith("Dead sensors in these takes: G08")
    found = rotation_noise(fitted(takes, usable.layout))
    floors = [found[name].floor for name in ("A12", "A13", "A14", "A15")]
    assert np.median([floor.floor_deg for floor in floors if floor is not None]) == pytest.approx(
        6.5, abs=1.5
    )
