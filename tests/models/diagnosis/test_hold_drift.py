"""What readings do while a pose is held: rivals stay rivals, warm-up is told apart, chance gets no name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.hold_drift import hold_drift
from glovecal_models.diagnosis.hold_text import hold_sentence
from glovecal_models.diagnosis.next_take import hold_next_take
from glovecal_models.diagnosis.posed_holds import degrees_of_spans, posed_holds
from glovecal_models.improvement.improve import improve
from glovecal_models.improvement.text import improvement_sentences
from glovecal_models.layout import Layout
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take

DATA = Path(__file__).parents[4] / "shared" / "data" / "flex-glove-holds"

RATE_HZ = 8.0
HOLD_S = 20.0
SENSORS = ("I_FLEX", "M_FLEX", "R_FLEX")
GAIN = np.array([1.0, -0.7, 1.3])


def held_poses(
    kind: str, seed: int = 0, *, poses: Sequence[str] = ("flat", "fist") * 4, size: float = 0.05
) -> list[Take]:
    """Two takes; ``kind`` is none, creep (two exponentials), relaxing (in the fist), or warm."""
    return [_take(kind, np.random.default_rng([seed, k]), k, poses, size) for k in range(2)]


def _take(kind: str, random: np.random.Generator, number: int, poses: Sequence[str], size: float) -> Take:
    time = np.arange(0.0, len(poses) * HOLD_S, 1 / RATE_HZ)
    hold = (time // HOLD_S).astype(int)
    since = time - hold * HOLD_S
    aim = np.array([0.0 if pose == "flat" else 1.0 for pose in poses])
    before = np.concatenate([[0.0], aim[:-1]])
    closed = before[hold] + (aim - before)[hold] * np.clip(since / 0.7, 0.0, 1.0)
    drift = np.zeros_like(time)
    if kind == "creep":
        drift = sum((_low_passed(closed, tau) for tau in (2.0, 9.0)), drift) / 2
    elif kind == "relaxing":
        free = np.array([pose == "fist" for pose in poses])
        drift = free[hold] * (1 - np.exp(-since / 5.0))
    elif kind == "warm":
        drift = 6 * (1 - np.exp(-(time + number * time[-1]) / 200.0))
    again = 0.02 * random.standard_normal(len(poses))[hold]
    noise = 0.01 * random.standard_normal((len(time), 3))
    wander = 0.003 * np.cumsum(random.standard_normal((len(time), 3)), axis=0) / np.sqrt(RATE_HZ)
    shape = (closed + again)[:, None] - size * drift[:, None] + noise + wander
    names = tuple(str(poses[i]) for i in hold.tolist())
    return Take(f"t{number}", "w", SENSORS, time, 200 + 100 * GAIN * shape, poses=names)


def _low_passed(values: np.ndarray, tau: float) -> np.ndarray:
    result, state = np.empty_like(values), 0.0
    for i, value in enumerate(values):
        state += (value - state) * -np.expm1(-1 / (RATE_HZ * tau))
        result[i] = state
    return result


def named_by_numbers(take: Take) -> Take:
    """With a reference of 0 and 1 in place of the poses' names."""
    level = np.array([[0.0 if pose == "flat" else 1.0] for pose in take.poses or ()])
    return replace(
        take, poses=None, rotations=("FIST",), reference=level, reference_time_s=take.time_s.copy()
    )


@pytest.mark.parametrize("kind", ["creep", "relaxing"])
def test_creep_and_a_relaxing_hand_are_left_as_rivals(kind):
    found = hold_drift(held_poses(kind), SENSORS)
    assert found.confidence_set == ("creep", "hand_relaxing")
    fist = next(pose for pose in found.poses if pose.pose == "fist")
    assert (np.sign(fist.share) == -np.sign(GAIN)).all(), "the readings go back"
    assert 0.03 < np.abs(fist.share).max() < 0.07, "of the span from flat to fist"
    assert 2 < fist.tau_s < 9
    sentence = hold_sentence(found)
    assert "consistent with creep, or the hand relaxing" in sentence
    assert "cannot be separated" in sentence
    assert "R_FLEX falls by" in sentence
    following = hold_next_take(found)
    assert following is not None
    assert "rigid form" in following.what
    assert following.separates == ("creep", "hand_relaxing")


def test_warm_up_goes_on_through_all_poses_and_is_no_creep():
    found = hold_drift(held_poses("warm"), SENSORS)
    assert found.confidence_set == ("warmup_drift", "garment_slip")
    assert "not creep" in hold_sentence(found)
    following = hold_next_take(found)
    assert following is not None
    assert "c.power_on_s" in following.what


def test_noise_that_wanders_gets_a_name_in_one_of_twenty_at_most():
    named = [seed for seed in range(40) if hold_drift(held_poses("none", seed), SENSORS).confidence_set]
    assert len(named) <= 2
    assert "not drift significantly" in hold_sentence(hold_drift(held_poses("none", 1), SENSORS))


def test_holds_around_a_rigid_form_decide():
    poses = ("flat", "fist", "flat", "rigid-rod") * 4
    creeps = hold_drift(held_poses("creep", poses=poses), SENSORS)
    assert creeps.confidence_set == ("creep",)
    assert hold_next_take(creeps) is None
    assert "the sensors creep" in hold_sentence(creeps)
    relaxes = hold_drift(held_poses("relaxing", poses=poses), SENSORS)
    assert relaxes.confidence_set == ("hand_relaxing",)
    assert relaxes.verdict == "named"


def test_too_few_holds_and_a_single_pose_are_not_judged():
    few = hold_drift(held_poses("creep", poses=("flat", "fist"))[:1], SENSORS)
    assert not few.confidence_set
    assert "4 are needed" in hold_sentence(few)
    moving = [replace(take, time_s=take.time_s / 10) for take in held_poses("creep")]
    assert hold_drift(moving, SENSORS).why_not == "no pose is held still for 8 s"
    fists = [take for take in held_poses("relaxing", poses=("fist",)) for _ in range(3)]
    assert "only one pose" in (hold_drift(fists, SENSORS).why_not or "")


def test_holds_without_a_name_are_found_by_their_readings():
    takes = held_poses("creep")
    known = posed_holds(takes, SENSORS)
    found = posed_holds([replace(take, poses=None) for take in takes], SENSORS)
    assert len(found) == len(known) == 16
    assert {hold.pose for hold in found} == {"pose 1", "pose 2"}
    assert all(hold.duration_s > HOLD_S - 2.5 for hold in found)
    assert hold_drift([replace(take, poses=None) for take in takes], SENSORS).confidence_set


def test_a_reference_of_0_and_1_names_poses_and_blames_no_effect():
    takes = [named_by_numbers(take) for take in held_poses("creep")]
    layout = Layout.from_columns("flex", SENSORS, ["FIST"])
    found = diagnose(takes, layout, linear=True)
    assert found.named is not None
    assert (found.named.effect, found.named.verdict) == ("creep", "ambiguous")
    assert found.named.confidence_set == ("creep", "hand_relaxing")
    assert found.reference_problems == (), "0 and 1 are no radians"
    assert "creep" in {item.effect for item in found.not_identifiable}
    improved = improve(takes, layout, "anna", TrainingSettings(method="linear"))
    assert [step.added for step in improved.steps] == [None]
    assert improved.stopped == "ambiguous"
    assert improved.next_take is not None
    assert improved.next_take.separates == ("creep", "hand_relaxing")
    assert any("or the hand relaxing" in sentence for sentence in improvement_sentences(improved))


def test_known_angles_give_the_drift_in_degrees():
    known = [
        replace(
            take,
            rotations=("I_FLEX",),
            reference=np.array([[80.0 if pose == "fist" else 5.0] for pose in take.poses or ()]),
            reference_time_s=take.time_s.copy(),
        )
        for take in held_poses("creep")
    ]
    layout = Layout.from_columns("flex", SENSORS, ["I_FLEX"])
    spans = degrees_of_spans(known, layout)
    assert spans == {"I_FLEX": 75.0}
    assert degrees_of_spans([named_by_numbers(take) for take in known], layout) == {}
    drift = hold_drift(known, SENSORS, deg_of_span=spans)
    assert drift.change_deg("I_FLEX", -0.04) == pytest.approx(-3.0)
    assert drift.change_deg("M_FLEX", -0.04) is None
    assert "degrees)" in hold_sentence(drift)


def test_a_sensor_that_never_changes_disturbs_nothing():
    takes = [
        replace(
            take,
            sensors=(*SENSORS, "DEAD"),
            readings=np.column_stack([take.readings, np.full(len(take.time_s), 0.6)]),
        )
        for take in held_poses("creep")
    ]
    assert hold_drift(takes, (*SENSORS, "DEAD")).confidence_set == ("creep", "hand_relaxing")


@pytest.mark.needs_shared_data
def test_a_real_flex_glove_is_consistent_with_creep_or_the_hand_relaxing_not_more():
    takes = [
        take
        for path in sorted(DATA.glob("*.csv"))
        if "grab" not in path.name
        for take in read_takes(path, equal_times="spread")
    ]
    found = hold_drift(takes, takes[0].sensors)
    assert found.confidence_set == ("creep", "hand_relaxing")
    fist = found.poses[0]
    assert (fist.pose, fist.holds) == ("fist", 5)
    assert (fist.share > 0).all(), "facts: in a held fist nearly all channels rise"
    assert 0.03 < np.median(fist.share) < 0.09
    assert 10 < fist.tau_s < 45
