"""Fast movement at any rate of frames is no fault of a sensor: what the reference shows too was the joint."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.effects.sensor_fault.sensor_fault import SensorFault
from glovecal_models.takes.reading_faults import dropouts, spikes
from glovecal_models.takes.take import Take

SENSORS = ("I_MCP", "I_PIP", "M_MCP", "M_PIP", "R_MCP")
RATES_HZ = (15, 30, 60, 90, 120)
TAKES, TAKE_S = 4, 40.0


def drummed(seed: int, rate_hz: float, lag_s: float = 0.0, spikes_per_s: float = 0.0) -> list[Take]:
    """Fingers that tap, half a tap lasting 50 to 100 ms, on a glove of curved sensors with 8 bits."""
    random = np.random.default_rng(seed)
    frames = round(TAKE_S * rate_hz)
    time_s = np.arange(frames) / rate_hz + random.normal(0.0, 0.0005, frames)
    gain = random.uniform(1.2, 2.5, len(SENSORS))
    takes = []
    for number in range(TAKES):
        angles = 20.0 + 8.0 * np.sin(0.2 * np.pi * time_s[:, None] + random.uniform(0.0, 6.0, len(SENSORS)))
        for joint in range(len(SENSORS)):
            at_s = 0.5
            while at_s < TAKE_S - 1.0:
                width = random.uniform(0.020, 0.045)
                tap = np.exp(-0.5 * ((time_s - at_s) / width) ** 2)
                angles[:, joint] += random.uniform(15.0, 50.0) * tap
                at_s += random.uniform(0.3, 2.0)
        readings = 40.0 + gain * angles + 0.004 * gain * angles**2
        readings = np.column_stack([np.interp(time_s - lag_s, time_s, column) for column in readings.T])
        readings += random.normal(0.0, 0.4, readings.shape)
        hit = random.random(frames) < spikes_per_s / rate_hz
        height = 0.5 * np.ptp(readings[:, 1]) * random.uniform(0.3, 1.0, hit.sum())
        readings[hit, 1] += random.choice([-1.0, 1.0], hit.sum()) * height
        reference = angles + random.normal(0.0, 0.4, angles.shape)
        takes.append(
            Take(
                f"take{number}", "wearing1", SENSORS, time_s, np.clip(np.round(readings), 0, 255),
                rotations=SENSORS, reference_time_s=time_s, reference=reference, simulated=True,
            )
        )  # fmt: skip
    return takes


def found(takes: list[Take]) -> list[tuple[str, str]]:
    own = {name: name for name in SENSORS}
    return [(each.where[0], each.kind) for each in SensorFault().find(takes, own)]


@pytest.mark.parametrize("lag_s", [0.0, 0.05])
@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_taps_of_a_sound_glove_are_no_fault(rate_hz, lag_s):
    assert found(drummed(11, rate_hz, lag_s)) == []


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_spikes_between_the_taps_are_found(rate_hz):
    names = found(drummed(12, rate_hz, spikes_per_s=0.5))
    assert ("I_PIP", "spikes") in names
    assert {where for where, _ in names} == {"I_PIP"}


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_without_a_reference_taps_are_no_fault_either(rate_hz):
    for take in drummed(13, rate_hz):
        unknown = np.full(len(take.time_s), np.nan)
        for readings in take.readings.T:
            span = float(np.ptp(readings))
            assert not spikes(take.time_s, readings, span, unknown).any()
            assert not dropouts(take.time_s, readings, span, unknown).any()


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_noise_and_coarse_steps_of_a_joint_that_rests_are_no_fault(rate_hz):
    """Its range is that of its noise."""
    random = np.random.default_rng(15)
    time_s = np.arange(60.0 * rate_hz) / rate_hz
    for noise in (0.3, 1.0, 3.0):
        readings = np.round(100.0 + random.normal(0.0, noise, len(time_s)))
        low, high = np.percentile(readings, (0.5, 99.5))
        for asked in (np.full(len(time_s), np.nan), random.normal(0.0, 0.2 * noise, len(time_s))):
            assert not spikes(time_s, readings, high - low, asked).any()
            assert not dropouts(time_s, readings, high - low, asked).any()


def test_without_a_reference_spikes_are_found_where_frames_come_fast_enough():
    takes = drummed(14, 120.0, spikes_per_s=0.5)
    hits = [
        spikes(take.time_s, take.readings[:, 1], 150.0, np.full(len(take.time_s), np.nan)).sum()
        for take in takes
    ]
    assert sum(hits) > 20
