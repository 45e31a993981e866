"""Garment slip: a wandering error is found with its rate; the small wandering of every glove is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from glovecal_models.effects.base.findings import ClaimedErrors
from glovecal_models.effects.catalogue import stored_correction
from glovecal_models.effects.garment_slip.garment_slip import (
    GROWS_S,
    GarmentSlip,
    SlipGrowth,
    SlipInterval,
    slip_growth,
)
from glovecal_models.effects.garment_slip.slip_components import (
    INSIDE,
    SlipComponents,
    slip_pieces,
)
from glovecal_models.effects.garment_slip.slip_components import slipping as joints_that_slip
from glovecal_models.effects.garment_slip.slip_rate import slip_rate
from glovecal_models.takes.take import Take

SLIP = GarmentSlip()


def every_glove(counts, generator):
    """0.4 deg with a correlation of 25 s in each sensor."""
    keep = np.exp(-1 / (60 * 25))
    noise = 0.4 * generator.normal(size=counts.shape)
    noise[1:] *= np.sqrt(1 - keep**2)
    return counts + 2 * lfilter([1], [1, -keep], noise, axis=0)


def slipping(rate_deg_per_sqrt_min):
    def slip(counts, generator):
        counts = every_glove(counts, generator)
        steps = generator.normal(size=len(counts)) * rate_deg_per_sqrt_min / np.sqrt(3600)
        counts[:, 1] += 2 * np.cumsum(steps)
        return counts

    return slip


def test_a_slip_is_found_with_its_rate(glove):
    takes = glove.takes(count=6, seconds=60, shape_counts=slipping(4.0))
    [finding] = SLIP.find(takes, glove.sensor_of, glove.errors(takes))
    assert finding.where == ("M_PIP",)
    assert finding.evidence["rate_deg_per_sqrt_min"] == pytest.approx(4.0, rel=0.4)
    assert "known pose" in finding.sentence


@pytest.mark.parametrize("noise_deg", [0.1, 0.3, 1.0])
def test_the_small_wandering_of_every_glove_is_not_named(glove, noise_deg):
    takes = glove.takes(count=6, seconds=60, shape_counts=every_glove, noise_deg=noise_deg)
    assert SLIP.find(takes, glove.sensor_of, glove.errors(takes)) == ()


def of_joints(*likelier_and_size: tuple[float, float]) -> list[SlipComponents | None]:
    return [SlipComponents(size, likelier, INSIDE, 0.0, 48) for likelier, size in likelier_and_size]


def test_joints_slip_alone_or_together_and_by_more_than_a_healthy_glove():
    nothing = [None] * 4
    assert joints_that_slip([*of_joints((5.0, 0.7)), *nothing]) == (0,)
    assert joints_that_slip([*of_joints((14.0, 0.5)), *nothing]) == ()
    assert joints_that_slip([*of_joints((3.0, 0.7)), *nothing]) == ()
    assert joints_that_slip([None, *of_joints((3.0, 0.7), (3.0, 0.4), (2.5, 0.4), (1.5, 0.7))]) == (1, 2, 3)
    assert joints_that_slip([*of_joints((5.0, 0.7)), *[None] * 19]) == ()
    assert joints_that_slip([*of_joints(*[(3.0, 0.7)] * 4), *[None] * 16]) == ()
    assert joints_that_slip(of_joints(*[(3.0, 0.7)] * 20)) == tuple(range(20))


def test_a_slip_below_the_frame_noise_is_not_named(glove):
    takes = glove.takes(count=6, seconds=60, shape_counts=slipping(1.0), noise_deg=2.0)
    assert SLIP.find(takes, glove.sensor_of, glove.errors(takes)) == ()


def test_a_curve_that_the_model_lacks_is_not_a_slip(glove):
    takes = glove.takes(
        count=6, shape_counts=lambda counts, generator: counts + 18 * np.sin(np.pi * (counts - 40) / 180)
    )
    assert SLIP.find(takes, glove.sensor_of, glove.errors(takes)) == ()


def test_without_errors_or_with_short_takes_nothing_is_said(glove):
    takes = glove.takes(count=2, seconds=15, shape_counts=slipping(4.0))
    assert SLIP.find(takes, glove.sensor_of) == ()
    times, errors = [take.time_s for take in takes], [error[:, 1] for error in glove.errors(takes)]
    assert slip_rate(times, errors, [take.reference[:, 1] for take in takes]) is None


def test_references_that_are_measured_here_and_there_tell_no_slip(glove):
    takes = glove.takes(count=4, seconds=30, shape_counts=slipping(4.0))
    errors = glove.errors(takes)
    for error in errors:
        error[np.arange(len(error)) % 10 > 1] = np.nan
    takes = [replace(take, context={"temperature_c": np.full(len(take.time_s), 20.0)}) for take in takes]
    assert SLIP.find(takes, glove.sensor_of, errors) == ()


def between_takes(size_deg):
    """Each take starts elsewhere and stays there."""

    def start(counts, generator):
        counts = every_glove(counts, generator)
        counts[:, 1] += 2 * size_deg * generator.normal()
        return counts

    return start


def test_a_slip_between_takes_is_found(glove):
    takes = glove.takes(count=8, shape_counts=between_takes(1.5))
    [finding] = SLIP.find(takes, glove.sensor_of, glove.errors(takes))
    assert (finding.where, finding.kind) == (("M_PIP",), "between takes")
    assert finding.size_deg == pytest.approx(1.5, rel=0.5)
    assert finding.evidence["likelihood_ratio_2ln"] > 3.3


def test_what_wearings_or_context_explain_is_no_slip(glove):
    takes = glove.takes(count=8, shape_counts=between_takes(1.5))
    means = np.array([error[:, 1].mean() for error in glove.errors(takes)])
    warmth = [np.full(len(take.time_s), 30 + 2 * mean) for take, mean in zip(takes, means, strict=True)]
    warmed = [
        replace(take, context={"temperature_c": each}) for take, each in zip(takes, warmth, strict=True)
    ]
    assert SLIP.find(warmed, glove.sensor_of, glove.errors(warmed)) == ()
    worn = [replace(take, wearing=f"w{number}") for number, take in enumerate(takes)]
    assert SLIP.find(worn, glove.sensor_of, glove.errors(worn)) == ()


def test_what_all_sensors_do_together_is_no_slip(glove):
    def together(counts, generator):
        return every_glove(counts, generator) + 3 * generator.normal()

    takes = glove.takes(count=8, shape_counts=together)
    assert SLIP.find(takes, glove.sensor_of, glove.errors(takes)) == ()


def test_a_slip_may_be_behind_a_column_that_goes_along_by_chance(glove):
    takes = glove.takes(count=8, shape_counts=between_takes(1.5))
    errors = glove.errors(takes)
    means = np.array([error[:, 1].mean() for error in errors])
    chance = np.random.default_rng(5).normal(size=len(takes))

    def warmed(per_take):
        return [
            replace(take, context={"temperature_c": np.full(len(take.time_s), 30 + 2 * value)})
            for take, value in zip(takes, per_take, strict=True)
        ]

    temperature, creep = stored_correction("temperature", {}), stored_correction("creep", {})
    by_chance = SLIP.weighed_against(temperature, warmed(chance), glove.sensor_of, errors)
    by_it = SLIP.weighed_against(temperature, warmed(means), glove.sensor_of, errors)
    assert by_chance is not None
    assert by_it is not None
    assert (by_chance.needs_cause, by_it.needs_cause) == (False, True)
    assert SLIP.weighed_against(creep, warmed(chance), glove.sensor_of, errors) is None


def test_a_walk_and_a_cause_of_many_takes_are_told_from_each_other(glove):
    """The same column beside a walk, and beside what follows it, in takes in turn cool and warm."""
    warmth = 30 + np.resize([-3.0, 4.0, 1.0], 15)
    temperature = stored_correction("temperature", {})

    def walk(since_donned_s, warm):
        return 0.6 * np.sqrt(since_donned_s)

    def follow(since_donned_s, warm):
        return np.full(len(since_donned_s), warm - 30)

    def weighed(error_deg, known=15):
        takes = []
        for number, (take, warm) in enumerate(zip(glove.takes(count=15), warmth, strict=True)):
            time_s = take.time_s - take.time_s[0]
            power_on_s = 30 + 60 * number + time_s
            added = error_deg(power_on_s, warm)
            readings = take.readings + 2 * np.array([0.0, 1.0, 0.0]) * np.reshape(added, (-1, 1))
            context = {"temperature_c": np.full(len(time_s), warm), "power_on_s": power_on_s}
            if number >= known:
                del context["temperature_c"]
            takes.append(replace(take, readings=readings, wearing="w1", context=context))
        found = SLIP.weighed_against(temperature, takes, glove.sensor_of, glove.errors(takes))
        assert found is not None
        return found.needs_cause, found.is_instead

    assert weighed(walk) == (False, True)
    assert weighed(follow) == (True, False)
    assert weighed(walk, known=14) == (False, None)


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("period", [0.5, 0.7, 1.0])
def test_a_warm_up_that_swings_is_no_slip(glove, seed, period):
    """What is regulated swings as it warms up, alike each time: powered three times, put on five times."""
    takes = []
    for number, take in enumerate(replace(glove, seed=seed).takes(count=15)):
        power_on_s = 30 + 60 * (number % 5) + take.time_s - take.time_s[0]
        swing = np.exp(-power_on_s / 200) * np.cos(2 * np.pi * np.log(power_on_s + 30) / period)
        readings = take.readings + 2 * 2.0 * np.outer(swing, [0.0, 1.0, 0.0])
        context = {"power_on_s": power_on_s}
        takes.append(replace(take, readings=readings, wearing=f"w{number // 3}", context=context))
    warm_up = stored_correction("warmup_drift", {})
    found = SLIP.weighed_against(warm_up, takes, glove.sensor_of, glove.errors(takes))
    assert found is not None
    assert (found.needs_cause, found.is_instead) == (True, False)


def test_the_claimed_variance_grows_in_proportion_to_the_time():
    interval = SlipInterval([SlipGrowth(2.0), SlipGrowth(0.0)])
    ages = np.array([-1.0, 0.0, 60.0, 240.0, 1e6, 1e9])
    added = interval.added_variance(ages, np.zeros((6, 2)))
    assert added[:4, 0] == pytest.approx([0.0, 0.0, 4.0, 16.0])
    assert added[4, 0] == added[5, 0] == pytest.approx(GROWS_S / 60.0 * 4.0)
    assert not added[:, 1].any()


def test_the_rate_of_the_growth_is_that_of_the_walk(glove):
    takes = glove.takes(count=6, seconds=60, shape_counts=slipping(4.0))
    left_out = [
        ClaimedErrors(
            take.name, "M_PIP", take.time_s, error[:, 1], take.reference[:, 1], np.full(len(error), 2.0), 2.0,
            take.sensors, take.readings,
        )
        for take, error in zip(takes, glove.errors(takes), strict=True)
    ]  # fmt: skip
    growth = slip_growth(left_out)
    assert growth.rate_deg_per_sqrt_min == pytest.approx(4.0, rel=0.4)
    settings = SLIP.learned(left_out, {})
    assert "in the first minute" in SLIP.sentence(settings, ["M_PIP"])
    assert SLIP.described_on(settings, "M_PIP")["rate_deg_per_sqrt_min"] == growth.rate_deg_per_sqrt_min


def test_a_piece_of_which_frames_were_dropped_counts_and_one_that_ends_early_does_not():
    """Few frames are left in stretches of 3 s. 45 s are four pieces of 10 s and a rest."""
    time_s = np.arange(0.0, 45.0, 1 / 60)
    is_slow, number = (time_s // 3) % 3 == 1, np.arange(len(time_s))
    time_s = time_s[~is_slow | (number % 30 == 0)]
    take = Take("a", "w1", ("I_PIP",), time_s, np.zeros((len(time_s), 1)))
    found = slip_pieces([take], [np.sin(time_s)], [np.cos(time_s)])
    assert found.inside_s.tolist() == [5.0, 15.0, 25.0, 35.0]
