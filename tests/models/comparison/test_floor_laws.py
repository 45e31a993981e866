"""Laws of the noise floor: of the takes, not of a model; never above its error; marked where it is unsure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.comparison.compare import compare
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.noise_floor import is_at_floor, takes_noise
from glovecal_models.layout import Layout
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take

SENSORS = ("I_MCP", "I_PIP")
LAYOUT = Layout.from_columns("two", SENSORS, SENSORS)


@pytest.fixture(scope="module")
def takes() -> list[Take]:
    plan = SessionPlan(seed=33, sensors=SENSORS, wearings=2, takes_per_wearing=2, take_s=30.0)
    return list(record_session(plan, ()).takes)


def floors(takes: list[Take]) -> list[NoiseFloor]:
    return list(takes_noise(takes, SENSORS).values())


def test_every_model_of_the_same_takes_has_the_same_floor(takes: list[Take]) -> None:
    found = [
        compare(train(takes, LAYOUT, "s", TrainingSettings(method=method, folds=0)), takes)
        for method in ("raw", "linear")
    ]
    for name, floor in takes_noise(takes, SENSORS).items():
        for one in found:
            beside = one.rotations[name].floor
            assert beside is not None
            assert beside.floor_deg == floor.floor_deg
            assert beside.high_deg <= one.rotations[name].rmse_deg


def test_a_healthy_recording_has_a_reliable_floor(takes: list[Take]) -> None:
    for floor in floors(takes):
        assert floor.is_reliable, floor.reasons
        assert floor.how == "still hand"


def test_clocks_that_disagree_make_a_floor_unreliable(takes: list[Take]) -> None:
    moved = [replace(take, reference_time_s=take.reference_time_s + 0.65) for take in takes]
    for floor in floors(moved):
        assert floor.reasons[0].startswith("the clocks are not repaired: readings and angles are 0.6")
        assert not is_at_floor(floor.high_deg, floor)


def test_few_frames_a_second_make_a_floor_unreliable(takes: list[Take]) -> None:
    few = [
        replace(
            take, time_s=take.time_s[::7], readings=take.readings[::7], poses=None,
            context={name: values[::7] for name, values in take.context.items()},
        )
        for take in takes
    ]  # fmt: skip
    assert all("frames a second were recorded" in floor.reasons[0] for floor in floors(few))


def test_a_reference_that_wanders_makes_a_floor_unreliable(takes: list[Take]) -> None:
    wandering = [
        replace(
            take, reference=take.reference + 4.0 * np.sin(2 * np.pi * take.reference_time_s / 6.0)[:, None]
        )
        for take in takes
    ]  # fmt: skip
    assert all(any("the reference wanders" in why for why in floor.reasons) for floor in floors(wandering))


@pytest.mark.parametrize(("rmse", "reliable"), [(5.0, True), (1.05, True), (0.95, True), (0.5, False)])
def test_a_floor_is_never_above_its_error(rmse: float, reliable: bool) -> None:
    floor = NoiseFloor(1.0, 0.9, 1.1, 0.0, "still hand", 20).beside(rmse)
    assert floor.low_deg <= floor.floor_deg <= floor.high_deg <= max(rmse, 1.1)
    assert floor.high_deg <= rmse or rmse > 1.1
    assert floor.is_reliable is reliable
    assert (floor.estimate_deg == 1.0) is (rmse < 1.0)
