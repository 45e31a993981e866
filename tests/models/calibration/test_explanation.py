"""The terms of an angle add up to what is served, for a take and frame by frame, whatever the effects."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.answer import AngleTerms
from glovecal_models.calibration.explanation import FrameExplainer, explain
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import FAULTY_SENSOR, LEAST_VARIANCE, GlovePredictor
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.effects.catalogue import stored_correction
from glovecal_models.effects.sensor_fault.fault_watch import FaultLimits
from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

LAYOUT = Layout.from_toml("""
name = "three-bends"
sensors = ["I_MCP", "I_PIP", "M_MCP"]
counts = [0, 255]
[rotations]
I_MCP = ["I_MCP"]
I_PIP = ["I_PIP"]
M_MCP = ["M_MCP", "I_MCP"]
[simulated]
I_DIP = "2/3 * I_PIP"
""")
MEASURED = LAYOUT.sensors
FRAMES = 260
UNITS = {"own_centre_deg": [20.0], "own_scale_deg": [30.0]}
LIMITS = FaultLimits(
    sensors=MEASURED,
    lag_s=(0.01, 0.1, 0.5),
    surprise_counts=((12.0, 20.0, 60.0),) * 3,
    still_s=(0.2,) * 3,
    rotations=MEASURED,
    move_lag_s=(0.01, 0.1, 1.0),
    move_deg=((0.5, 5.0, 30.0),) * 3,
    reads=tuple((name,) for name in MEASURED),
)
FOLLOWED = {
    "start": {"noise": 0.1, "slope": 0.0, "slope_sd": 0.01, "curvature_sd": 1e-4},
    "steepest_per_s": 0.05,
}
"""How the sensors follow the temperature."""
WALK = {"rate_deg_per_sqrt_min": 6.0}
CHOICES: dict[str, tuple[tuple[float, ...], dict[str, Any]]] = {
    "lag": ((0.05,), {}),
    "creep": ((0.5, 1.1, 2.5), UNITS),
    "hysteresis": ((5.0,), {}),
    "cross_coupling": ((), {"neighbours": ["M_MCP"], **UNITS}),
    "temperature": ((), {"low": 4.0, "high": 9.0, "usual": 5.0, **FOLLOWED, **UNITS}),
    "donning_shift": ((), {"wearings": ["monday"], **UNITS}),
}
"""Effects with columns: their shape and settings."""
WITHOUT_COLUMNS = (
    ("garment_slip", {"rotations": dict.fromkeys(MEASURED, WALK)}),
    ("sensor_fault", {"where": ["I_MCP"], "live": LIMITS.to_settings()}),
)


def base_model() -> CalibrationModel:
    generator = np.random.default_rng(0)
    readings = generator.uniform(20.0, 230.0, (200, 3))
    angles = 0.5 * (readings - 100.0) + generator.normal(0, 0.8, (200, 3))
    time_s = np.arange(200) / 100.0
    take = Take("t", "w", MEASURED, time_s, readings, MEASURED, time_s, angles)
    trained = train([take], LAYOUT, "anna", TrainingSettings(method="linear", folds=0))
    return replace(trained, sensor_centre=np.full(3, 120.0), sensor_scale=np.full(3, 50.0))


BASE = base_model()


def model_with(names: tuple[str, ...], seed: int, *, extra: bool = True) -> CalibrationModel:
    """Weights of each effect at random, on two of the rotations."""
    generator = np.random.default_rng(seed)
    effects = []
    for name in names:
        shape, constants = CHOICES[name]
        on = tuple(generator.permutation(MEASURED)[:2].tolist())
        weights = generator.normal(
            0, 1.5, (2, len(stored_correction(name, constants).weights(constants).names))
        )
        grid = np.tile(np.array(shape, dtype=float), (2, 1))
        effects.append(AddedEffect(name, on, constants, grid, weights, np.zeros(2)))
    for name, constants in WITHOUT_COLUMNS if extra else ():
        nothing = np.empty((3, 0))
        shape = np.zeros((3, 0))
        effects.append(AddedEffect(name, MEASURED, constants, shape, nothing, np.zeros(3)))
    return replace(BASE, effects=tuple(effects))


def recorded(seed: int, wearing: str) -> Take:
    """Smooth motion in which the first sensor drops out for ten frames, and a pause of two seconds."""
    generator = np.random.default_rng(seed)
    time_s = np.cumsum(generator.uniform(0.005, 0.015, FRAMES))
    time_s[100:] += 2.0
    phase, speed = generator.uniform(0, 6, 3), generator.uniform(1, 4, 3)
    readings = 120 + 60 * np.sin(time_s[:, None] * speed + phase)
    readings[180:190, 0] = 0.0
    context = {"temperature_c": np.where(np.arange(FRAMES) % 7 == 0, np.nan, 6.0)}
    reference = 0.5 * (readings - 100.0)
    return Take("pinch", wearing, MEASURED, time_s, readings, MEASURED, time_s, reference, context)


def is_whole(angle: AngleTerms) -> None:
    """Degrees add up to the angle, claimed variances to the claimed one."""
    assert abs(sum(item.degrees for item in angle.terms) - angle.degrees) < 1e-9
    claimed = sum(
        item.variance_deg2 for item in angle.terms if item.is_claimed and item.variance_deg2 is not None
    )
    assert abs(max(claimed, LEAST_VARIANCE) - angle.sd_deg**2) < 1e-9


@given(
    st.lists(st.sampled_from(sorted(CHOICES)), max_size=6, unique=True),
    st.integers(0, 1000),
    st.sampled_from(["monday", "tuesday"]),
    st.integers(0, FRAMES - 1),
    st.booleans(),
)
@settings(max_examples=25)
def test_terms_add_up_to_what_is_served(
    names: list[str], seed: int, wearing: str, frame: int, extra: bool
) -> None:
    model, take = model_with(tuple(names), seed, extra=extra), recorded(seed, wearing)
    served = GlovePredictor(model).predict_take(take.time_s, take.readings, take.context, wearing)
    found = explain(model, take, float(take.time_s[frame]) + 1e-4)
    assert found.frame == frame
    for at, angle in enumerate(found.rotations):
        is_whole(angle)
        assert abs(angle.degrees - served.mean[frame, at]) < 1e-9
        assert abs(angle.sd_deg - served.sd[frame, at]) < 1e-9
        assert angle.flags == served.flags[frame, at]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_frame_by_frame_gives_the_terms_of_the_take(seed: int) -> None:
    names = tuple(np.random.default_rng(seed).permutation(sorted(CHOICES)).tolist())
    model, take = model_with(names, seed), recorded(seed, "tuesday")
    live = FrameExplainer(model)
    for number in range(FRAMES):
        context = {name: float(column[number]) for name, column in take.context.items()}
        said = live.frame(float(take.time_s[number]), take.readings[number], context, take.wearing)
        if number not in (0, 50, 99, 100, 184, 189, 190, FRAMES - 1):
            continue
        of_take = explain(model, take, float(take.time_s[number]))
        assert list(said.faulty_sensors) == list(of_take.faulty_sensors)
        assert said.transient_s == pytest.approx(of_take.transient_s)
        assert said.silent == of_take.silent
        for one, other in zip(said.rotations, of_take.rotations, strict=True):
            is_whole(one)
            assert [item.name for item in one.terms] == [item.name for item in other.terms]
            for mine, its in zip(one.terms, other.terms, strict=True):
                assert abs(mine.degrees - its.degrees) < 1e-9
                assert mine.variance_deg2 == pytest.approx(its.variance_deg2, abs=1e-9)


def angle_of(model: CalibrationModel, take: Take, frame: int, rotation: str) -> AngleTerms:
    found = explain(model, take, float(take.time_s[frame])).rotations
    return next(item for item in found if item.rotation == rotation)


def test_terms_are_in_the_order_in_which_they_are_applied() -> None:
    effects = model_with(("creep", "lag"), 4).effects
    model = replace(BASE, effects=tuple(replace(item, rotations=("I_MCP", "I_PIP")) for item in effects[:2]))
    angle = angle_of(model, recorded(4, "monday"), 90, "I_PIP")
    assert [item.name for item in angle.terms] == ["base", "creep", "lag", "measurement noise"]
    assert [item.sd_deg is None for item in angle.terms] == [False, True, True, False]
    assert angle.readings == {"I_PIP": pytest.approx(recorded(4, "monday").readings[90, 1])}
    assert "Not stored: the model has no standard deviation of this term." in angle.sentences


def test_a_rule_has_the_terms_of_what_it_follows() -> None:
    model, take = model_with(("hysteresis", "creep"), 5), recorded(5, "monday")
    rule, source = angle_of(model, take, 95, "I_DIP"), angle_of(model, take, 95, "I_PIP")
    assert [item.name for item in rule.terms] == [item.name for item in source.terms]
    for mine, its in zip(rule.terms, source.terms, strict=True):
        assert mine.degrees == pytest.approx(2 / 3 * its.degrees)
    assert rule.sources == ("I_PIP",)
    assert not rule.readings


def test_a_faulty_sensor_is_a_term_and_a_word() -> None:
    model, take = model_with(("creep",), 6), recorded(6, "monday")
    found = explain(model, take, float(take.time_s[185]))
    assert found.faulty_sensors == ("I_MCP",)
    angle = next(item for item in found.rotations if item.rotation == "I_MCP")
    held = next(item for item in angle.terms if item.kind == "held")
    assert abs(held.degrees) > 5.0
    assert held.sd_deg is not None
    assert angle.flags & FAULTY_SENSOR
    assert any(sentence.startswith("Held:") for sentence in angle.sentences)
    assert any(sentence.startswith("Faulty sensor: I_MCP") for sentence in found.sentences)


def test_a_transient_is_said_until_it_is_over() -> None:
    model, take = model_with(("creep",), 7), recorded(7, "monday")
    after_pause = explain(model, take, float(take.time_s[110]))
    assert after_pause.transient_s == pytest.approx(take.time_s[110] - take.time_s[100])
    assert any(sentence.startswith("Transient: creep began anew") for sentence in after_pause.sentences)
    instant = explain(model_with(("cross_coupling",), 7), take, float(take.time_s[0]))
    assert instant.transient_s is None


def test_a_wearing_that_nobody_knows_is_said_and_has_a_standard_deviation() -> None:
    model, take = model_with(("donning_shift",), 8), recorded(8, "tuesday")
    on = model.effects[0].rotations[0]
    angle = angle_of(model, take, 10, on)
    term = next(item for item in angle.terms if item.name == "donning_shift")
    assert term.degrees == 0.0
    assert term.is_claimed
    assert term.sd_deg is not None
    assert term.sd_deg > 1.0
    said = explain(model, take, float(take.time_s[10])).sentences
    assert "Wearing 'tuesday' was not in training: donning_shift is not corrected." in said


def test_a_stored_covariance_of_weights_gives_a_standard_deviation() -> None:
    model = model_with(("cross_coupling",), 9, extra=False)
    item = model.effects[0]
    lanes, count = item.weights.shape
    known = replace(item, covariance=np.tile(0.04 * np.eye(count), (lanes, 1, 1)))
    take, rotation = recorded(9, "monday"), item.rotations[0]
    angle = angle_of(replace(model, effects=(known,)), take, 30, rotation)
    term = next(one for one in angle.terms if one.name == "cross_coupling")
    z = (take.readings[30, 2] - 120.0) / 50.0
    base = next(one for one in angle.terms if one.kind == "base").degrees
    expected = 0.2 * np.hypot(z, z * (base - 20.0) / 30.0)
    assert term.sd_deg == pytest.approx(expected)
    assert term.is_claimed
    is_whole(angle)


def test_a_correction_that_is_absurd_is_left_out_and_said() -> None:
    item = model_with(("temperature",), 10, extra=False).effects[0]
    model = replace(BASE, effects=(replace(item, weights=np.full_like(item.weights, 1e6)),))
    angle = angle_of(model, recorded(10, "monday"), 20, item.rotations[0])
    is_whole(angle)
    assert not angle.is_corrected
    assert any(sentence.startswith("Not corrected:") for sentence in angle.sentences)


def test_what_was_measured_and_what_repairs_change_of_it() -> None:
    take = recorded(11, "monday")
    clock = {"offset_s": {"pinch": 0.05}, "common_s": 0.05, "per_take": False}
    nothing = np.empty((3, 0))
    offset = AddedEffect("clock_offset", MEASURED, clock, np.zeros((3, 2)), nothing, np.zeros(3))
    found = explain(replace(BASE, effects=(offset,)), take, float(take.time_s[60]))
    measured = found.of("I_PIP").measured
    assert measured is not None
    assert measured.recorded_deg == pytest.approx(take.reference[60, 1])
    (repair,) = measured.repairs
    assert repair.name == "clock_offset"
    assert repair.degrees is not None
    assert abs(repair.degrees) > 0.1
    assert measured.degrees == pytest.approx(measured.recorded_deg + repair.degrees)
    angle = found.of("I_PIP")
    is_whole(angle)
    (said,) = [one for one in angle.sentences if one.startswith("Measured:")]
    assert "recorded" in said
    assert "clock_offset" in said


def test_a_time_outside_the_take_is_refused() -> None:
    with pytest.raises(BadInput, match="'pinch' lasts from"):
        explain(BASE, recorded(12, "monday"), 1e4)
