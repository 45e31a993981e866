"""Saturation: found where a sensor is cut off, not where the hand rests; the interval widens on one side."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.effects.base.findings import ClaimedErrors
from glovecal_models.effects.saturation.saturated_band import SaturatedBand, saturated_bands
from glovecal_models.effects.saturation.saturation import Saturation
from glovecal_models.errors import BadInput
from glovecal_models.takes.take import Take

SATURATION = Saturation()


def cut_off(takes: list[Take], share: float, end: str = "high") -> list[Take]:
    """The second sensor clipped so that ``share`` of its readings are at one end."""
    every = np.concatenate([take.readings[:, 1] for take in takes])
    limit = np.quantile(every, 1 - share if end == "high" else share)
    clip = np.minimum if end == "high" else np.maximum
    result = []
    for take in takes:
        readings = take.readings.copy()
        readings[:, 1] = clip(readings[:, 1], limit)
        result.append(replace(take, readings=readings))
    return result


@pytest.mark.parametrize("end", ["high", "low"])
def test_a_sensor_that_is_cut_off_is_found(glove, end):
    takes = cut_off(glove.takes(), 0.2, end)
    [finding] = SATURATION.find(takes, glove.sensor_of)
    assert (finding.effect, finding.where, finding.kind) == ("saturation", ("M_PIP",), end)
    assert "sensor stops responding here" in finding.sentence
    assert (finding.size_deg or 0.0) > 4
    assert finding.evidence["density_over_next_bands_1"] > 3
    assert finding.evidence["reference_spread_over_usual_1"] > 2


def test_before_anything_is_learned_the_band_counts_as_unsure_as_the_reference_spreads(glove):
    [band] = saturated_bands(cut_off(glove.takes(), 0.2), glove.sensor_of)
    np.testing.assert_array_equal(band.extra_sd(np.array([100.0, band.high])), [0.0, band.extra_sd_deg])
    assert SaturatedBand.of(json.loads(json.dumps(band.to_settings()))) == band


def left_out(takes: list[Take]) -> list[ClaimedErrors]:
    """Errors of a straight line that claims 2 degrees everywhere, on the second rotation."""
    found = []
    for take in takes:
        error = (take.readings[:, 1] - 40.0) / 2.0 - take.reference[:, 1]
        four = np.full(len(error), 4.0)
        found.append(
            ClaimedErrors(
                take.name, "M_PIP", take.time_s, error, take.reference[:, 1], four, 4.0, take.sensors,
                take.readings,
            )
        )  # fmt: skip
    return found


@pytest.mark.parametrize("end", ["high", "low"])
def test_what_is_learned_covers_the_rail_and_is_narrow_elsewhere(glove, end):
    takes = cut_off(glove.takes(count=8), 0.2, end)
    bands = saturated_bands(takes, glove.sensor_of)
    settings = SATURATION.learned(left_out(takes[:4]), {"bands": [band.to_settings() for band in bands]})
    interval = SATURATION.interval(settings, ["M_PIP"], takes[0].sensors, np.array([4.0]))
    at_rail, elsewhere = [], []
    for item in left_out(takes[4:]):
        variance = item.variance + interval.added_variance(item.since_start_s, item.readings)[:, 0]
        rail = item.readings[:, 1] == (bands[0].high if end == "high" else bands[0].low)
        at_rail.append(np.abs(item.error[rail]) <= 1.96 * np.sqrt(variance[rail]))
        elsewhere.append(np.sqrt(variance[~bands[0].is_near(item.readings[:, 1])]))
    assert np.concatenate(at_rail).mean() > 0.9
    assert np.concatenate(elsewhere).max() < 1.0, "what training took for noise is taken back"


def test_a_falling_sensor_opens_to_the_other_side(glove):
    def falling(counts, generator):
        return np.maximum(270 - counts, 120)

    bands = saturated_bands(glove.takes(shape_counts=falling), glove.sensor_of)
    assert {(band.end, band.towards) for band in bands} == {("low", 1)}


def test_a_sensor_that_is_used_up_slowly_is_found(glove):
    """Each degree takes a share of the light that is left: no readings pile up at a rail."""

    def used_up(counts, generator):
        return np.column_stack([counts[:, 0], 40 + 190 * -np.expm1(-(counts[:, 1] - 40) / 60), counts[:, 2]])

    [band] = saturated_bands(glove.takes(shape_counts=used_up, noise_deg=0.6), glove.sensor_of)
    assert (band.rotation, band.end, band.towards) == ("M_PIP", "high", 1)
    assert band.high - band.low > 190 * 0.06, "several steps wide"
    assert 0.5 < band.lost_deg < band.extra_sd_deg


def test_a_posture_at_the_end_is_no_saturation(glove):
    """The hand rests fully bent for a quarter of the time: readings pile up, but so does the reference."""
    takes = []
    for take in glove.takes():
        readings, reference = take.readings.copy(), take.reference.copy()
        rest = slice(400, 400 + len(readings) // 4)
        generator = np.random.default_rng(1)
        readings[rest] = np.round(222 + 0.6 * generator.normal(size=readings[rest].shape))
        reference[rest] = 91 + 0.3 * generator.normal(size=reference[rest].shape)
        takes.append(replace(take, readings=readings, reference=reference))
    assert SATURATION.find(takes, glove.sensor_of) == ()


def test_a_healthy_glove_and_one_without_reference(glove):
    takes = glove.takes()
    assert SATURATION.find(takes, glove.sensor_of) == ()
    blind = [replace(take, reference=np.full_like(take.reference, np.nan)) for take in cut_off(takes, 0.2)]
    assert SATURATION.find(blind, glove.sensor_of) == ()


def test_what_cannot_be_used_is_named(glove):
    takes = glove.takes(count=1)
    with pytest.raises(BadInput, match="no sensor 'X' for rotation I_PIP; it has I_PIP"):
        SATURATION.find(takes, {"I_PIP": "X"})
    with pytest.raises(BadInput, match="errors of 2 takes were given for 1 takes"):
        SATURATION.find(takes, glove.sensor_of, [np.zeros(3), np.zeros(3)])
    with pytest.raises(BadInput, match=r"errors have shape \(3,\), expected \(1800, 3\)"):
        SATURATION.find(takes, glove.sensor_of, [np.zeros(3)])


def test_a_dead_band_in_mid_range_is_found(glove):
    """As of a push-pull stage: nothing changes about the middle, and its width is missing outside."""
    takes = []
    middle = np.median(np.concatenate([take.readings[:, 1] for take in glove.takes()]))
    for take in glove.takes():
        readings = take.readings.copy()
        readings[:, 1] -= np.clip(readings[:, 1] - middle, -12.0, 12.0)
        takes.append(replace(take, readings=readings))
    [band] = saturated_bands(takes, glove.sensor_of)
    assert (band.sensor, band.end, band.towards) == ("M_PIP", "middle", 0)
    width = band.high - band.low
    depths = band.depth(np.array([(band.low + band.high) / 2, band.high, band.low, band.high + width]))
    np.testing.assert_allclose(depths, [0.0, width, width, 3 * width], atol=1e-9)
    assert "between" in SATURATION.find(takes, glove.sensor_of)[0].sentence
