"""Faults seen live: what is planted is flagged, a sound sensor is not, and nothing looks ahead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.effects.sensor_fault.fault_watch import FaultLimits, FaultWatch
from glovecal_models.effects.sensor_fault.live_check import fault_limits
from glovecal_models.takes.take import Take


@pytest.fixture(scope="module")
def limits_of():
    def learned(takes: list[Take]) -> FaultLimits:
        sensors = takes[0].sensors
        return fault_limits(takes, sensors, (), {name: [name] for name in sensors})

    return learned


def ages(limits: FaultLimits, take: Take) -> np.ndarray:
    """(N, S) seconds since the last good reading."""
    watch = FaultWatch(limits, take.sensors)
    return np.stack([watch.frame(t, row)[1] for t, row in zip(take.time_s, take.readings, strict=True)])


def spikes(readings):
    readings[[200, 500, 501, 900, 1400]] += 60


def dropout(readings):
    readings[700:706] = 0


def stuck(readings):
    moving = np.abs(readings[60:] - readings[:-60])
    start = 300 + int(moving[300:1200].argmax())
    readings[start : start + 60] = readings[start]


@pytest.mark.parametrize(("fault", "least_share"), [(spikes, 1.0), (dropout, 0.9), (stuck, 0.5)])
def test_planted_faults_are_flagged_where_they_are(glove, limits_of, fault, least_share):
    takes = glove.takes(count=4)
    readings = takes[3].readings.copy()
    fault(readings[:, 0])
    faulty = readings[:, 0] != takes[3].readings[:, 0]
    found = ages(limits_of(takes[:3]), replace(takes[3], readings=readings)) > 0
    assert found[faulty, 0].mean() >= least_share
    assert found[~faulty].mean() < 0.002


def test_a_sound_glove_is_hardly_ever_flagged(glove, limits_of):
    takes = glove.takes(count=5)
    limits = limits_of(takes[:3])
    assert np.mean([ages(limits, take) > 0 for take in takes[3:]]) < 0.001


def test_the_last_good_reading_is_kept_and_grows_old(glove, limits_of):
    takes = glove.takes(count=3)
    limits = FaultLimits.of(limits_of(takes).to_settings())
    watch, take = FaultWatch(limits, takes[0].sensors), takes[0]
    readings = take.readings.copy()
    readings[100:103, 1] = 0.0
    good, age_s = [watch.frame(take.time_s[row], readings[row]) for row in range(103)][-1]
    assert good[1] == readings[99, 1]
    assert age_s[1] == pytest.approx(take.time_s[102] - take.time_s[99])
    assert not age_s[[0, 2]].any()


def test_it_begins_anew_after_a_gap_and_a_reset(glove, limits_of):
    takes = glove.takes(count=3)
    watch = FaultWatch(limits_of(takes), takes[0].sensors)
    watch.frame(0.0, np.full(3, 100.0))
    assert not watch.frame(2.0, np.full(3, 5.0))[1].any(), "after a gap anything may be"
    watch.reset()
    assert not watch.frame(2.01, np.full(3, 100.0))[1].any()
    assert watch.frame(2.02, np.full(3, 5.0))[1].all()
