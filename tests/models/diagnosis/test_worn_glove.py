"""Five seconds of a worn glove: healthy ones are left alone, each fault has its own finding."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.calibration.methods import Method
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.diagnosis.worn_glove import worn_glove_findings
from glovecal_models.layout import Layout
from glovecal_models.simulation.protocol import segments
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take
from glovecal_models.takes.take import Take

RATE_HZ = 60.0
LAYOUT = Layout.built_in("cyberglove18")


def seconds(seed: int, wearing: int = 0) -> Take:
    """Five seconds of free motion."""
    glove = SimulatedGlove(seed, "cyberglove18", wearing=wearing)
    take = simulate_take(glove, segments("evaluation", seed), rate_hz=RATE_HZ, name="worn").take
    kept = slice(60, 60 + int(5 * RATE_HZ))
    return replace(
        take, time_s=take.time_s[kept], readings=take.readings[kept], rotations=(),
        reference=np.empty((0, 0)), reference_time_s=np.empty(0), poses=None,
        context={name: values[kept] for name, values in take.context.items()},
    )  # fmt: skip


@pytest.fixture(scope="module")
def model() -> CalibrationModel:
    glove = SimulatedGlove(1, "cyberglove18")
    takes = [
        simulate_take(glove, segments(motion, 1), rate_hz=30, name=motion).take
        for motion in ("key_poses", "cross_couple", "evaluation")
    ]
    return train(takes, LAYOUT, "anna", TrainingSettings(method="linear", folds=0))


def changed(take: Take, change: Callable[[np.ndarray], None]) -> Take:
    readings = take.readings.copy()
    change(readings)
    return replace(take, readings=readings)


def at(sensor: str) -> int:
    return LAYOUT.sensors.index(sensor)


def parts(take: Take, model: CalibrationModel | None, nominal_hz: float = RATE_HZ) -> list[str]:
    return [finding.part for finding in worn_glove_findings(take, nominal_hz, model)]


def test_a_healthy_glove_is_left_alone(model: CalibrationModel) -> None:
    assert parts(seconds(1), model) == []
    assert parts(seconds(1), None) == []


@pytest.mark.parametrize("method", ["linear", "lmc_gpr"])
def test_beyond_a_narrow_training_the_joint_may_have_moved(method: Method) -> None:
    """A model that learned a third of each joint's range says nothing of the rest."""
    glove = SimulatedGlove(1, "cyberglove18")
    every = simulate_take(glove, segments("evaluation", 1), rate_hz=30, name="evaluation").take
    angles = every.reference_at_frames(every.rotations)
    middle, third = np.nanmedian(angles, axis=0), np.nanstd(angles, axis=0)
    near = np.abs(angles - middle).max(axis=1, initial=0.0) < 1.5 * third.max()
    few = replace(
        every, time_s=every.time_s[near], readings=every.readings[near], reference=angles[near],
        reference_time_s=every.time_s[near], poses=None,
        context={name: values[near] for name, values in every.context.items()},
    )  # fmt: skip
    narrow = train([few], LAYOUT, "anna", TrainingSettings(method=method, folds=0, samples=200))
    assert parts(seconds(1), narrow) == []


def rest_wrist(readings: np.ndarray) -> None:
    readings[:, at("W_FLEX")] = 100 + np.arange(len(readings)) // 7 % 2


def test_a_joint_at_rest_trembles_between_two_values(model: CalibrationModel) -> None:
    assert parts(changed(seconds(1), rest_wrist), model) == []


def stick(readings: np.ndarray) -> None:
    readings[:, at("R_PIP")] = 97


def jump(readings: np.ndarray) -> None:
    readings[20::40, at("M_MCP")] += 90


def jump_all(readings: np.ndarray) -> None:
    readings[20::40] += 90


def sag(readings: np.ndarray) -> None:
    readings -= 160


def slip(readings: np.ndarray) -> None:
    readings[:, at("I_MCP")] += 190


@pytest.mark.parametrize(
    ("change", "part", "says"),
    [
        (stick, "sensor", "R_PIP is always 97"),
        (jump, "sensor", r"M_MCP \(\d+\)"),
        (jump_all, "cable", "Most sensors jump"),
        (sag, "supply", "sensors read below all"),
        (slip, "wearing", "I_MCP read outside"),
    ],
)
def test_each_fault_has_its_finding(model: CalibrationModel, change, part: str, says: str) -> None:
    found = worn_glove_findings(changed(seconds(1), change), RATE_HZ, model)
    assert [finding.part for finding in found] == [part]
    assert re.search(says, found[0].sentence)
    assert found[0].advice.endswith(".")


def test_lost_frames_are_the_cables(model: CalibrationModel) -> None:
    take = seconds(1)
    kept = np.arange(len(take.time_s)) % 30 < 20
    thin = replace(
        take, time_s=take.time_s[kept], readings=take.readings[kept],
        context={name: values[kept] for name, values in take.context.items()},
    )  # fmt: skip
    assert parts(thin, model) == ["cable"]
    assert parts(take, model, nominal_hz=100.0) == ["cable"]


def test_a_hand_at_rest_hides_what_is_stuck(model: CalibrationModel) -> None:
    resting = changed(seconds(1), lambda readings: readings.__setitem__(slice(None), readings[:1]))
    assert parts(resting, model) == ["motion"]
