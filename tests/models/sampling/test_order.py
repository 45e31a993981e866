"""The random order of a sampling, the step that is asked again, and samplings that were stored before."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from asked_session import RECORDING, asked_session

from glovecal_models.layout import Layout
from glovecal_models.sampling.catalogue import REPEAT_PART, SHUFFLED, in_random_order, make_protocol
from glovecal_models.sampling.engine import Sampling, begin_sampling
from glovecal_models.sampling.protocol import Protocol
from glovecal_models.sampling.sampled_takes import repeatability, sampled_takes
from glovecal_models.sampling.state import GloveReading, SamplingState
from glovecal_models.simulation.simulated_glove import SimulatedGlove

LAYOUT = Layout.built_in("cyberglove18")
FIXED = make_protocol("new_subject", LAYOUT)
SEEDS = range(30)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_same_steps_in_another_order_and_the_first_one_again(seed: int) -> None:
    protocol = make_protocol("new_subject", LAYOUT, seed=seed)
    *asked, check = protocol.steps
    assert sorted(step.name for step in asked) == sorted(step.name for step in FIXED.steps)
    assert [step.kind in SHUFFLED for step in asked] == [step.kind in SHUFFLED for step in FIXED.steps]
    others = [step for step in asked if step.kind not in SHUFFLED]
    assert others == [step for step in FIXED.steps if step.kind not in SHUFFLED]
    first = next(step for step in asked if step.kind in SHUFFLED)
    assert (check.repeats, check.kind, check.part) == (first.name, "verification", REPEAT_PART)
    assert check.ask == first.ask
    parts = [step.part for step in asked]
    assert sum(one != other for one, other in itertools.pairwise(parts)) == len(set(parts)) - 1
    assert Protocol.from_document(protocol.to_document()) == protocol
    assert protocol == make_protocol("new_subject", LAYOUT, seed=seed)
    assert protocol.capture_s <= 300


def test_no_widgets_of_a_rotation_rise_or_fall_with_time() -> None:
    firsts = set()
    for seed in SEEDS:
        steps = make_protocol("new_subject", LAYOUT, seed=seed).steps
        firsts.add(next(step.name for step in steps if step.kind in SHUFFLED))
        for rotation in LAYOUT.rotations:
            angles = [
                step.angles[rotation]
                for step in steps
                if step.kind == "fk_cross_couple" and rotation in step.angles
            ]
            if len(angles) > 2:
                rises = np.diff(angles)
                assert (rises > 0).any(), (seed, rotation)
                assert (rises < 0).any(), (seed, rotation)
    assert len(firsts) > 10


def test_without_a_seed_the_order_is_the_papers() -> None:
    assert FIXED.seed is None
    assert [step.name for step in FIXED.steps if step.part == "IM_ABD"] == [
        "IM_ABD+0", "IM_ABD+10", "IM_ABD+20", "IM_ABD+30",
    ]  # fmt: skip
    for unchanged in (make_protocol("active", LAYOUT), make_protocol("ik_only", LAYOUT)):
        assert in_random_order(unchanged, 1) == unchanged


def test_a_sampling_stored_before_keeps_its_order() -> None:
    state = begin_sampling(FIXED, LAYOUT.sensors)
    document = state.to_document()
    del document["protocol"]["seed"]
    for step in document["protocol"]["steps"]:
        del step["repeats"]
    assert SamplingState.from_document(document).protocol == FIXED
    assert repeatability(SamplingState.from_document(document)) is None


def slipping(counts: float):
    """A fault: every sensor reads ``counts`` more after half a minute."""

    def disturb(state: SamplingState, reading: GloveReading) -> GloveReading:
        later = reading.time_s > 30.0
        return replace(reading, values=reading.values + counts * later)

    return disturb


SHORT = replace(
    FIXED,
    steps=tuple(step for step in FIXED.steps if step.part in ("loosen", "key-poses-1", "IM_ABD", "touch")),
)


@pytest.mark.parametrize("motion", ["hold", "move"])
def test_the_step_asked_twice_tells_of_a_slip(motion: str) -> None:
    protocol = next(
        protocol for seed in SEEDS if (protocol := in_random_order(SHORT, seed)).steps[-1].motion == motion
    )
    whole = asked_session(protocol, SimulatedGlove(1), seed=1, at_once_s=0.2)
    found = repeatability(whole.state)
    assert found is not None
    assert found.rms_deg is not None
    assert found.rms_deg < 5.0
    assert not found.is_much
    assert found.sentence() in whole.state.sentences
    assert "degrees RMS (worst" in found.sentence()
    takes = sampled_takes(whole.state, {RECORDING: whole.take}, name="s")
    (check,) = [each for each in takes if each.part == REPEAT_PART]
    assert (check.kind, check.take.rotations) == ("verification", ())
    slipped = asked_session(protocol, SimulatedGlove(1), seed=1, disturb=slipping(25.0), at_once_s=0.2)
    much = repeatability(slipped.state)
    assert much is not None
    assert much.is_much
    assert much.sentence().endswith("The glove has moved on the hand, or its readings drift.")
    assert all(abs(item.counts - 25.0) < 12.0 for item in much.sensors)


def test_an_angle_typed_wrong_is_corrected_in_the_step_asked_again() -> None:
    seed = next(
        seed for seed in SEEDS if make_protocol("fk_only", LAYOUT, seed=seed).steps[-1].motion == "move"
    )
    sampling = Sampling(begin_sampling(make_protocol("fk_only", LAYOUT, seed=seed), LAYOUT.sensors))
    check = sampling.state.protocol.steps[-1]
    sampling.event(0.0, "redo", step=check.repeats, angle_deg=17.0)
    *_, changed = sampling.state.protocol.steps
    assert changed.needs == "the 17 degree widget"
    assert list(changed.angles.values()) == [17.0]
    assert list(sampling.state.protocol.step(check.repeats).angles.values()) == [17.0]
