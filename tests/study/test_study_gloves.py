"""The gloves of the study: dealt in turn, the same in every run, a little of everything at every moment."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from blind_glove import BlindGlove, Nuisance
from further_forms import dealt_forms
from further_takes import FurtherTakes
from glove_choices import (
    BITS,
    EVERY_RATE_HZ,
    MOTIONS,
    NUISANCES,
    RATES_HZ,
    RECORDED_INPUTS,
    RECORDED_UNNAMED,
    clean,
    few_takes,
    with_cause,
)
from study_parts import LEAD_S, PARTS, QUICK, REMEMBERING, StudyChoices
from wandering_reference import WANDER_DEG

from glovecal_models.diagnosis.residual_answer import NextTake
from glovecal_models.effects.base.relations import AIR, CROSSED
from glovecal_models.simulation.causes.catalogue import KNOWN_CAUSES

FEW = StudyChoices(gloves=3, clean=6, repairs=2, pairs=6, second_names=36, ceilings=48, recorded=44)


def open_forms(name: str) -> set[str]:
    return {form.name for form in dealt_forms(name, set_aside=False)}


def test_every_form_and_device_comes_in_turn() -> None:
    made = [with_cause("names", "hysteresis", 1.3, number) for number in range(len(open_forms("hysteresis")))]
    gloves = [glove for glove in made if glove is not None]
    assert gloves == [with_cause("names", "hysteresis", 1.3, number) for number in range(len(made))]
    assert len({glove.seed for glove in gloves}) == len(made)
    for begin in (0, 3, 6, 9):
        three = gloves[begin : begin + 3]
        assert {glove.bits for glove in three} == set(BITS) == {8, 10, 12}
        assert {glove.rate_hz for glove in three} == set(RATES_HZ) == {30, 60, 100}
    for begin in (0, 4, 8):
        assert {glove.nuisance for glove in gloves[begin : begin + 4]} == set(NUISANCES)
    assert {len(glove.causes[0].channels or ()) for glove in gloves} == {0, 1}
    assert {glove.causes[0].form for glove in gloves} == open_forms("hysteresis")


@pytest.mark.parametrize("part", PARTS)
def test_devices_are_not_tied_to_each_other_in_any_part(part: str) -> None:
    gloves = PARTS[part].gloves(StudyChoices())
    assert len({glove.key for glove in gloves}) == len(gloves)
    rates = EVERY_RATE_HZ if part == "few-takes" else RATES_HZ
    assert {(glove.rate_hz, glove.bits) for glove in gloves} == set(product(rates, BITS))
    assert {(glove.nuisance, glove.rate_hz) for glove in gloves} == set(product(NUISANCES, rates))


def test_every_motion_comes_with_every_rate_in_few_takes() -> None:
    gloves = [few_takes(number) for number in range(300)]
    assert {(glove.motion, glove.rate_hz) for glove in gloves} == set(product(MOTIONS, EVERY_RATE_HZ))
    assert {glove.duration_s for glove in gloves} == {120.0}


def test_an_early_stop_has_a_little_of_everything() -> None:
    names = PARTS["second-names"].gloves(FEW)
    assert [glove.truth for glove in names[: len(KNOWN_CAUSES)]] == list(KNOWN_CAUSES)
    every = PARTS["second-names"].gloves(StudyChoices())
    for name in KNOWN_CAUSES:
        found = [glove.causes[0].form for glove in every if glove.truth == name]
        assert set(found) == open_forms(name)
    ceilings = PARTS["ceiling"].gloves(FEW)
    assert [bool(glove.causes) for glove in ceilings] == [True, False] * 24
    assert {glove.truth for glove in ceilings[: 2 * len(RECORDED_INPUTS)]} == {*RECORDED_INPUTS, "none"}
    recorded = PARTS["recorded"].gloves(FEW)
    assert {(glove.truth, glove.size) for glove in recorded[:6]} == set(product(RECORDED_UNNAMED, (1.3, 2.6)))
    assert {glove.causes[0].form for glove in recorded} == open_forms("unknown:context") | {"grip_pressure"}
    sizes = PARTS["sizes"].gloves(FEW)
    assert {(glove.truth, glove.size) for glove in sizes[:36]} == set(product(KNOWN_CAUSES, (0.65, 2.6)))
    repair = PARTS["repair"].gloves(FEW)
    first = repair[: len(KNOWN_CAUSES) + len(REMEMBERING)]
    assert {glove.truth for glove in first} == set(KNOWN_CAUSES)
    assert {glove.truth for glove in first if glove.lead_s == LEAD_S} == set(REMEMBERING)


def test_a_quick_study_has_everything() -> None:
    for part in PARTS.values():
        assert 0 < len(part.gloves(QUICK)) <= 40


def test_only_the_effects_that_were_asked_for_are_hidden() -> None:
    wanted = StudyChoices(gloves=2, second_names=3, ceilings=6, recorded=4, effects=("lag",))
    assert {glove.truth for glove in PARTS["second-names"].gloves(wanted)} == {"lag"}
    assert {glove.truth for glove in PARTS["ceiling"].gloves(wanted)} == {"lag", "none"}
    assert PARTS["recorded"].gloves(wanted) == []


def short(nuisance: Nuisance, rate_hz: float = 60.0) -> BlindGlove:
    glove = clean(0, linear=False)
    glove = replace(glove, wearings=2, takes_per_wearing=2, take_s=20.0, bystander="none")
    return replace(glove, nuisance=nuisance, rate_hz=rate_hz)


def test_a_wandering_reference_is_slow_and_the_same_for_the_twin() -> None:
    wandering, steady = short("reference"), short("white")
    again = short("reference")
    for take, same, other, twin in zip(
        wandering.takes, again.takes, steady.takes, wandering.clean_takes, strict=True
    ):
        assert np.array_equal(take.readings, other.readings)
        assert np.array_equal(take.reference, same.reference)
        assert np.array_equal(take.reference, twin.reference)
        wander = take.reference - other.reference
        assert np.sqrt(np.mean(wander**2, axis=0)) == pytest.approx(WANDER_DEG)
        seconds = np.diff(wander, axis=0) * wandering.rate_hz
        assert np.abs(seconds).max() < 2.0  # degrees a second
        assert np.corrcoef(wander.T)[0, 1] < 0.999
    assert not np.allclose(
        wandering.takes[0].reference - steady.takes[0].reference,
        wandering.takes[1].reference - steady.takes[1].reference,
    )
    assert wandering.floor_deg == pytest.approx(np.hypot(steady.floor_deg, WANDER_DEG))
    later = wandering.also("natural", 20.0, 0).reference - steady.also("natural", 20.0, 0).reference
    assert np.sqrt(np.mean(later**2, axis=0)) == pytest.approx(WANDER_DEG)


def test_in_other_air_temperature_and_humidity_go_different_ways() -> None:
    glove = short("white")
    further = FurtherTakes(glove)
    takes = further.recorded(NextTake(AIR.name, AIR.what, 48, (), "air", 6))
    [last] = {take.wearing for take in takes}
    assert last == glove.takes[-1].wearing
    warm, damp = (
        np.array([take.context[name].mean() for take in takes]) for name in ("temperature_c", "humidity_pct")
    )
    cool, bag, heated = warm.reshape(2, 3).T
    assert (cool < bag).all()
    assert (bag < heated).all()
    cool, bag, heated = damp.reshape(2, 3).T
    assert (heated < cool).all(), "warmed air is drier"
    assert (heated < bag).all()
    begun_s, volts = (
        np.array([take.context[name][0] for take in takes]).reshape(2, 3)
        for name in ("power_on_s", "supply_v")
    )
    assert (np.diff(begun_s, axis=1) > 0).all()
    assert (begun_s[:, 0] < 300).all(), "switched off for another battery before each round"
    assert abs(volts[1, 0] - volts[0, -1]) > 0.1


def test_what_is_changed_one_at_a_time_is_changed_alone_and_goes_on() -> None:
    glove = short("white")
    further = FurtherTakes(glove)
    crossed = NextTake(CROSSED.name, CROSSED.what, 48, (), "crossed", 6)
    takes = [glove.takes[-1], *further.recorded(crossed), *further.recorded(crossed)]
    wearings = [take.wearing for take in takes]
    volts, power_s = (np.array([t.context[name][0] for t in takes]) for name in ("supply_v", "power_on_s"))
    changes = {
        "battery": np.abs(np.diff(volts)) > 0.1,
        "wearing": np.array([one != next_ for one, next_ in pairwise(wearings)]),
        "power": np.diff(power_s) < 0,
    }
    for name, place in (("battery", 0), ("wearing", 1), ("power", 2)):
        others = np.delete(np.arange(12), np.arange(place, 12, 3))
        assert not changes[name][others].any()
    assert changes["wearing"][1::3].all()
    assert changes["power"][2::3].all()
    assert changes["battery"][0::3].sum() >= 3
    assert len(set(wearings)) == 5, "no wearing comes back"


def test_takes_have_the_frame_rate_of_the_glove() -> None:
    for rate_hz in RATES_HZ:
        glove = short("white", rate_hz)
        assert np.diff(glove.takes[0].time_s) == pytest.approx(1 / rate_hz)
