"""The clock offset as an effect: the scan's offsets, and a drift in long takes where it pays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.effects.delay.clock_offset import ClockOffsetEffect, clock_drift

CLOCK = ClockOffsetEffect()


def on_other_clock(take, offset_s, drift_ppm=0.0):
    middle = take.time_s.mean()
    time = take.reference_time_s
    return replace(take, reference_time_s=time + offset_s + 1e-6 * drift_ppm * (time - middle))


def test_each_take_is_put_back(glove):
    takes = glove.takes(count=2)
    moved = [on_other_clock(takes[0], 0.4), takes[1]]
    [finding] = CLOCK.find(moved, glove.sensor_of)
    assert (finding.where, finding.kind) == (("take0",), "offset")
    assert finding.evidence["offset_s"] == pytest.approx(0.4, abs=0.01)
    assert finding.evidence["unexplained_after_pct"] < finding.evidence["unexplained_before_pct"]
    back = CLOCK.repaired(moved)
    np.testing.assert_allclose(back[0].reference_time_s, takes[0].reference_time_s, atol=0.01)
    assert back[1] is moved[1]


@pytest.mark.parametrize(("offset_s", "drift_ppm"), [(0.3, 800.0), (0.0, -1200.0)])
def test_a_drift_comes_back(glove, offset_s, drift_ppm):
    [take] = glove.takes(count=1, seconds=90)
    moved = on_other_clock(take, offset_s, drift_ppm)
    [clock] = CLOCK.clocks([moved])
    assert clock.drift_ppm == pytest.approx(drift_ppm, abs=120)
    assert clock.offset_s == pytest.approx(offset_s, abs=0.005)
    np.testing.assert_allclose(clock.repaired(moved).reference_time_s, take.reference_time_s, atol=0.01)
    [finding] = CLOCK.find([moved], glove.sensor_of)
    assert finding.kind == "drift"
    assert "ppm" in finding.sentence
    [plain] = CLOCK.clocks([moved], drift=False)
    assert plain.drift is None


def test_no_drift_is_invented(glove):
    [long] = glove.takes(count=1, seconds=90)
    assert clock_drift(long, 0.0) is None
    assert CLOCK.find([long], glove.sensor_of) == ()
    [short] = glove.takes(count=1, seconds=40)
    assert clock_drift(on_other_clock(short, 0.0, 1500.0), 0.0) is None


def test_a_range_that_is_too_small_is_said(glove):
    [take] = glove.takes(count=1)
    found = CLOCK.find([on_other_clock(take, 3.2)], glove.sensor_of)
    assert all(item.kind == "range too small" for item in found)
