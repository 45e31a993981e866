"""A glove's latency from taps: planted ones come back, odd taps are left out, the impossible is refused."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.errors import BadInput
from glovecal_models.takes.tap_latency import tap_latency

SENSORS = ("A", "B", "C", "D")
GAIN = np.array([-2.0, -1.2, 0.1, 0.0])
"""Counts per degree of the finger that taps."""
KEY_STOPS_LATER_S = 0.004
"""The finger's stop is found so much after the press at most: half the peak of a smoothed speed."""


def finger_deg(time_s: np.ndarray, pressed_s: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """A finger that hits the key at each time, rests on it and is lifted slowly."""
    angle = np.zeros_like(time_s)
    for at in pressed_s:
        strike, lift, wide = random.uniform(0.05, 0.08), random.uniform(0.25, 0.35), random.uniform(20, 30)
        down = np.clip((time_s - (at - strike)) / strike, 0, 1)
        up = np.clip((time_s - (at + random.uniform(0.08, 0.14))) / lift, 0, 1)
        angle += wide * (down**2 - up**2 * (3 - 2 * up))
    return angle


def tapped(latency_s: float, *, rate_hz: float = 120.0, taps: int = 25, seed: int = 1):
    """Frame times, readings and key times."""
    random = np.random.default_rng(seed)
    pressed = 2.0 + np.cumsum(random.uniform(0.8, 1.2, taps))
    true_time = np.arange(0.0, pressed[-1] + 2.0, 0.0005)
    angle = finger_deg(true_time, pressed, random)
    time = np.arange(0.0, pressed[-1] + 2.0, 1 / rate_hz)
    seen = np.interp(time - latency_s, true_time, angle)
    noise = random.normal(0.0, 0.5, (len(time), len(SENSORS)))
    return time, np.rint(500 + seen[:, None] * GAIN + noise), pressed


@pytest.mark.parametrize(("latency_s", "rate_hz"), [(0.0, 120.0), (0.045, 60.0), (0.25, 120.0)])
def test_a_planted_latency_comes_back_with_its_standard_deviation(latency_s, rate_hz):
    found = tap_latency(*_ordered(tapped(latency_s, rate_hz=rate_hz)), key_latency_s=0.0)
    assert latency_s - 0.002 <= found.seconds <= latency_s + KEY_STOPS_LATER_S + 0.002
    assert 0.0001 < found.sd_s < 0.002
    assert (found.taps, found.used) == (25, 25)
    assert set(found.sensors[:2]) == {"A", "B"}
    later = tap_latency(*_ordered(tapped(latency_s, rate_hz=rate_hz)), key_latency_s=0.01)
    assert later.seconds == pytest.approx(found.seconds + 0.01)
    usual = tap_latency(*_ordered(tapped(latency_s, rate_hz=rate_hz)))
    assert usual.seconds == pytest.approx(found.seconds + 0.0125)
    assert usual.sd_s**2 == pytest.approx(found.sd_s**2 + 0.015**2 / 12)


def test_a_press_without_a_tap_is_left_out():
    time, readings, pressed = tapped(0.03)
    stray = pressed[3::6][:3] + 0.5
    found = tap_latency(time, readings, SENSORS, np.sort([*pressed, *stray]))
    assert found.seconds == pytest.approx(0.033 + 0.0125, abs=0.003)
    assert found.used <= 25


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda t, x, k: (t, x, k[:15]), "15 of 15 taps"),
        (lambda t, x, k: (t, x, k + 1e4), "0 of 25 taps"),
        (lambda t, x, k: (t, np.zeros_like(x), k), "no sensor follows"),
    ],
)
def test_what_cannot_be_measured_is_refused(change, why):
    time, readings, pressed = change(*tapped(0.03))
    with pytest.raises(BadInput, match=why):
        tap_latency(time, readings, SENSORS, pressed)


def _ordered(made):
    time, readings, pressed = made
    return time, readings, SENSORS, pressed
