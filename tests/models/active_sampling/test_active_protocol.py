"""A simulated person led by what teaches most, against the fixed protocol."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from asked_session import RECORDING, AskedSession, asked_session
from assumed_angles import assumed_angles

from glovecal_models.calibration.text import plan_sentences
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_plan import plan_training
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.diagnosis.residual_answer import NextTake
from glovecal_models.errors import BadInput, NotTrainable
from glovecal_models.layout import Layout
from glovecal_models.sampling.active.known_readings import (
    ExpectedReadings,
    known_from_state,
    known_from_takes,
)
from glovecal_models.sampling.active.next_step import (
    NextStep,
    candidate_steps,
    propose_for_model,
    register_candidates,
    still_possible,
)
from glovecal_models.sampling.active.proposal import propose
from glovecal_models.sampling.catalogue import Equipment, make_protocol
from glovecal_models.sampling.engine import NotNow, Sampling, begin_sampling
from glovecal_models.sampling.limits import SAMPLING_LIMITS
from glovecal_models.sampling.sampled_takes import sampled_takes
from glovecal_models.sampling.state import Attempt, GloveReading, NextSteps, SamplingState
from glovecal_models.simulation.protocol import free_segment
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take
from glovecal_models.takes.take import Take

LAYOUT = Layout.built_in("cyberglove18")
SEED = 5
SHARE = 0.6


@pytest.fixture(scope="module")
def proposals() -> list[NextSteps]:
    return []


@pytest.fixture(scope="module")
def active(proposals: list[NextSteps]) -> AskedSession:
    """Stopped at ``SHARE`` of the fixed protocol's capture time."""
    choose, until_s = NextStep(LAYOUT), SHARE * make_protocol("fk_only", LAYOUT).capture_s - 8

    def chosen(state: SamplingState) -> NextSteps:
        proposals.append(choose(state) if state.capture_s < until_s else NextSteps((), True, ""))
        return proposals[-1]

    return asked_session(
        make_protocol("active", LAYOUT), SimulatedGlove(SEED), seed=SEED, choose=chosen, at_once_s=0.2
    )


def labelled(session: AskedSession) -> list[Take]:
    takes = [each.take for each in sampled_takes(session.state, {RECORDING: session.take}, name="s")]
    return [take for take in takes if take.rotations]


def samples(takes: list[Take]) -> int:
    return sum(int(np.isfinite(take.reference).any(axis=1).sum()) for take in takes)


def assumed_rmse(takes: list[Take]) -> float:
    """Over a free motion that nobody trained on, of the rotations that sensors read."""
    glove = SimulatedGlove(SEED)
    test = simulate_take(glove, free_segment(77, 20.0), seed=77, rate_hz=60)
    angles = assumed_angles(LAYOUT, known_from_takes(takes, LAYOUT.sensors), test.take.readings)
    assert len(angles) == 17
    truth = {name: test.truth[:, LAYOUT.rotations.index(name)] for name in angles}
    return float(np.sqrt(np.mean([np.mean((angles[name] - truth[name]) ** 2) for name in angles])))


def test_60_percent_of_time_and_samples_are_as_good_as_the_fixed_protocol(active: AskedSession) -> None:
    fixed = asked_session(make_protocol("fk_only", LAYOUT), SimulatedGlove(SEED), seed=SEED, at_once_s=0.2)
    assert active.state.capture_s <= SHARE * fixed.state.capture_s
    assert samples(labelled(active)) <= SHARE * samples(labelled(fixed))
    assert assumed_rmse(labelled(active)) < 1.2 * assumed_rmse(labelled(fixed))
    asked = [step.angles for step in active.state.protocol.steps]
    for rotation in ("W_ABD", "IM_ABD", "T_IP", "I_PIP"):
        assert len({angles[rotation] for angles in asked if rotation in angles}) >= 3


def test_what_was_expected_of_a_step_comes_true(proposals: list[NextSteps], active: AskedSession) -> None:
    """The standard deviation with the readings that really came is near that with the expected ones."""
    told = [each.document for each in proposals if "step" in each.document]
    after = [each["steps"][0]["rms_sd_after_deg"] for each in told[:-1]]
    found = [each["rms_sd_deg"] for each in told[1:]]
    assert np.median(np.abs(np.array(found) / after - 1)) < 0.05
    assert found[-1] < 0.2 * found[0] < 0.2 * 90 / np.sqrt(12)
    assert told[3]["sentences"][-1].startswith(f"Next: {told[3]['steps'][0]['name']}. Expected standard dev")


def test_expected_readings_are_learned(active: AskedSession) -> None:
    known = known_from_state(active.state)
    item = LAYOUT.correspondence("T_IP")
    expected = ExpectedReadings(known, LAYOUT.correspondences)
    place = LAYOUT.sensors.index("T_IP")
    for step in candidate_steps(LAYOUT):
        if list(step.angles) == ["T_IP"]:
            near = np.abs(active.truth[:, LAYOUT.rotations.index("T_IP")] - step.angles["T_IP"]) < 2
            really = active.take.readings[near]
            own = expected.of(step, item)[:, item.sensors.index("T_IP")]
            span = known.high[place] - known.low[place]
            assert own.mean() == pytest.approx(really[:, place].mean(), abs=0.08 * span)


def test_the_whole_of_it_survives_a_document(active: AskedSession) -> None:
    state = SamplingState.from_document(active.state.to_document())
    assert state == active.state
    choose = NextStep(LAYOUT)
    assert choose(state) == choose(active.state)
    assert len(str(state.to_document())) < 200_000


def with_skipped(state: SamplingState, *names: str) -> SamplingState:
    left_out = [Attempt(name, "skipped", ("the user left it out.",)) for name in names]
    return replace(state, attempts=[*state.attempts, *left_out])


def test_what_a_person_left_out_is_not_proposed_again(active: AskedSession) -> None:
    """Nor is a widget that was recorded; poses are, their errors are new each time."""
    steps = candidate_steps(LAYOUT)
    asked = [step for step in active.state.protocol.steps if step.part == "W_FLEX"]
    fresh = still_possible(steps, begin_sampling(make_protocol("active", LAYOUT), LAYOUT.sensors))
    assert fresh == steps
    now = [step.name for step in still_possible(steps, active.state)]
    assert {step.name for step in steps} - set(now) == {
        step.name for step in active.state.protocol.steps if step.kind == "fk_cross_couple"
    }
    assert any(name.startswith("W_FLEX") for name in now)
    poses = with_skipped(active.state, "fist")
    assert "fist" not in [step.name for step in still_possible(steps, poses)]
    twice = still_possible(steps, with_skipped(active.state, asked[0].name, asked[1].name))
    assert not any(step.part == "W_FLEX" for step in twice)


def test_it_ends_when_nothing_is_left_or_the_time_is_up(active: AskedSession) -> None:
    choose = NextStep(LAYOUT)
    late = choose(replace(active.state, capture_s=SAMPLING_LIMITS.longest_capture_s))
    assert (late.are_last, [step.name for step in late.steps]) == (True, ["flat-end", "fist-end"])
    known = known_from_state(active.state)
    sure = tuple(replace(block, samples=1e6, shared_sd_deg=0.01) for block in known.blocks)
    certain = replace(known, blocks=sure)
    found = propose(LAYOUT, certain, [step for step in candidate_steps(LAYOUT) if step.name == "flat"])
    assert found.is_enough
    assert found.verdict().startswith("Enough: the next step, flat, would lower the expected error by less")
    assert "is below a frame's noise of 1.3." in found.to_document()["sentences"][-1]
    poses = propose(LAYOUT, replace(certain, blocks=certain.blocks[:2] * 200), [found.ranked[0].step])
    assert "degrees are left (a frame's noise: 1.3)" in poses.verdict()


def test_without_free_motion_nothing_can_be_proposed() -> None:
    state = begin_sampling(make_protocol("active", LAYOUT), LAYOUT.sensors)
    ending = NextStep(LAYOUT)(with_skipped(state, "loosen", "flat-start", "fist-start"))
    assert ending.are_last
    assert "0 readings of free motion" in ending.sentence
    with pytest.raises(BadInput, match="no pose or widget is known"):
        propose(LAYOUT, known_from_takes([take_of(60)], LAYOUT.sensors), [])


def take_of(frames: int) -> Take:
    readings = np.random.default_rng(0).uniform(50, 200, (frames, len(LAYOUT.sensors)))
    return Take("free", "w", LAYOUT.sensors, np.arange(frames) / 60, readings)


def test_a_growing_protocol_waits_for_what_comes_next() -> None:
    ready: list[NextSteps] = []

    def choose(state: SamplingState) -> NextSteps | None:
        return ready.pop() if ready else None

    sampling = Sampling(begin_sampling(make_protocol("active", LAYOUT), LAYOUT.sensors), choose=choose)
    assert sampling.state.said.startswith("Step 1. Open and close the hand")
    for _ in range(3):
        sampling.event(0.0, "skip")
    assert (sampling.state.phase, sampling.state.step) == ("choosing", "")
    for event in ("skip", "go"):
        with pytest.raises(NotNow):
            sampling.event(0.0, event)
    frame(sampling, 0.1)
    assert sampling.state.phase == "choosing"
    sampling.tick(9.0)
    assert sampling.state.phase == "lost"
    for at_s in np.arange(9.1, 9.8, 0.1).tolist():
        frame(sampling, at_s)
    assert sampling.state.phase == "choosing"
    sampling.event(9.8, "undo")
    assert sampling.state.step == "fist-start"
    sampling.event(9.8, "skip")
    first, second = candidate_steps(LAYOUT)[:2]
    ready.append(NextSteps((first,), False, "It teaches.", {"rms_sd_deg": 3.0}))
    frame(sampling, 9.9)
    assert (sampling.state.phase, sampling.state.step) == ("waiting", first.name)
    assert sampling.state.said.startswith("It teaches. Step 4. ")
    assert sampling.state.expected == {"rms_sd_deg": 3.0}
    again = Sampling(SamplingState.from_document(sampling.state.to_document()), choose=choose)
    again.interrupted(9.9)
    again.event(9.9, "skip")
    ready.append(NextSteps((second,), True, ""))
    frame(again, 10.0)
    again.event(10.0, "skip")
    assert again.state.phase == "done"


def frame(sampling: Sampling, at_s: float) -> None:
    values = np.full(len(LAYOUT.sensors), 100.0)
    sampling.frame(at_s, GloveReading(at_s, round(at_s * 10), "run", values))
    sampling.tick(at_s)


def test_equipment_and_registered_steps_are_candidates() -> None:
    own = Equipment({"IM_ABD": (0, 12), "T_IP": ()}, {"claw": {"I_PIP": 70.0}})
    names = [step.name for step in candidate_steps(LAYOUT, own)]
    assert [name for name in names if name.startswith("IM_ABD")] == ["IM_ABD+0", "IM_ABD+12"]
    assert "claw" in names
    assert not any(name.startswith("T_IP") for name in names)
    assert Equipment.from_document(own.to_document()).pose_deg == own.pose_deg
    comb = replace(
        next(step for step in candidate_steps(LAYOUT) if step.name == "IM_ABD+15"),
        name="comb+15",
        angles={"IM_ABD": 15.0, "MR_ABD": 15.0, "RP_ABD": 15.0},
    )
    forget = register_candidates(lambda layout, equipment: [comb])
    assert comb in candidate_steps(LAYOUT)
    forget()
    assert comb not in candidate_steps(LAYOUT)


def test_a_model_tells_what_it_should_learn_next(active: AskedSession) -> None:
    """Without wrist and one thumb joint among its takes, these come first."""
    missing = {"W_FLEX", "W_ABD", "T_IP"}
    takes = [take for take in labelled(active) if not missing & set(take.rotations)]
    poses = [take for take in takes if "I_PIP" in take.rotations]
    model = train(poses, LAYOUT, "a", TrainingSettings(method="linear", folds=0))
    found = propose_for_model(model, takes)
    assert set(found.ranked[0].step.angles) <= missing
    assert found.sentences[0].startswith("Assumed, not learned: how far ")


def test_what_a_model_learned_goes_before_what_is_assumed() -> None:
    """Noise, and how far from straight, of a model with dense reference."""
    take = simulate_take(SimulatedGlove(SEED), free_segment(3, 20.0), seed=3, rate_hz=30).take
    few = replace(take, rotations=("I_PIP",), reference=take.reference[:, [take.rotations.index("I_PIP")]])
    model = train([few], LAYOUT, "a", TrainingSettings(folds=0, samples=200))
    found = propose_for_model(model, [few], [take_of(300)])
    assert found.learned == ("I_PIP",)
    assert found.noise_deg["I_PIP"] == pytest.approx(np.sqrt(model.rotations[0].regressor.noise_variance))
    assert found.sd_deg["I_PIP"] < found.noise_deg["I_PIP"] < found.sd_deg["T_IP"]


def test_a_sampling_stopped_early_trains_what_it_can() -> None:
    """A rotation that was held at one angle only is left out, with a sentence; alone it is refused."""
    take = replace(
        take_of(60),
        rotations=("I_PIP", "W_ABD"),
        reference_time_s=np.arange(60) / 60,
        reference=np.column_stack([np.linspace(0, 90, 60), np.full(60, 15.0)]),
    )
    plan = plan_training([take], LAYOUT, "a", TrainingSettings(method="linear", folds=0))
    assert [task.rotation for task in plan.tasks] == ["I_PIP"]
    assert "W_ABD was measured at 15 degrees only" in plan_sentences(plan)[-1]
    alone = replace(take, rotations=("W_ABD",), reference=take.reference[:, 1:])
    with pytest.raises(NotTrainable, match="is 15 degrees in all 60 samples"):
        plan_training([alone], LAYOUT, "a", TrainingSettings(method="linear", folds=0))


def test_a_diagnosis_asks_for_its_own_take() -> None:
    wanted = NextTake("fast", "Swing fast.", 25, ("lag", "clock_offset"), "fast")
    assert wanted.reason.startswith("The diagnosis cannot tell lag and clock offset apart")
