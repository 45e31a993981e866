"""A simulated session repeats to the byte, moves like a hand and leaves the floor it says."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.errors import BadInput
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.scene import play_scene
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_glove import SessionGlove
from glovecal_models.simulation.session_plan import TAKE_MOTIONS, AirChange, SessionPlan, schedule
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes

SHORT = SessionPlan(seed=3, wearings=2, takes_per_wearing=2, take_s=12.0)
CAUSES = (
    Cause("hysteresis", "single_play"),
    Cause("clock_offset", "per_take"),
    Cause("donning_shift", "offset"),
)


def same(one: Take, other: Take) -> bool:
    return (
        one.name == other.name
        and one.readings.tobytes() == other.readings.tobytes()
        and one.reference.tobytes() == other.reference.tobytes()
        and one.time_s.tobytes() == other.time_s.tobytes()
        and all(one.context[name].tobytes() == other.context[name].tobytes() for name in one.context)
    )


def speed_deg_s(truth: np.ndarray, rate_hz: float) -> float:
    return float(np.sqrt(np.mean(np.diff(truth, axis=0) ** 2)) * rate_hz)


def test_the_same_arguments_give_the_same_bytes():
    one, other = record_session(SHORT, CAUSES), record_session(SHORT, CAUSES)
    assert all(same(a, b) for a, b in zip(one.takes + one.clean, other.takes + other.clean, strict=True))
    assert one.causes == other.causes
    another = record_session(SessionPlan(seed=4, wearings=2, takes_per_wearing=2, take_s=12.0), CAUSES)
    assert not same(one.takes[0], another.takes[0])


def test_the_twin_is_the_session_without_causes():
    with_causes, without = record_session(SHORT, CAUSES), record_session(SHORT)
    assert all(same(a, b) for a, b in zip(with_causes.clean, without.takes, strict=True))
    assert with_causes.floor_deg == without.floor_deg


def test_takes_are_named_and_marked():
    session = record_session(SHORT)
    assert [take.name for take in session.takes] == ["w1-t1", "w1-t2", "w2-t1", "w2-t2"]
    assert [take.wearing for take in session.takes] == ["wearing-1", "wearing-1", "wearing-2", "wearing-2"]
    assert all(take.simulated for take in session.takes + session.clean)
    assert [truth.shape for truth in session.truth] == [(720, 5)] * 4


@pytest.mark.parametrize("nuisance", ["white", "drift", "posture"])
def test_a_static_calibration_of_a_healthy_glove_reaches_the_floor(nuisance):
    session = record_session(SessionPlan(seed=1, nuisance=nuisance))
    readings = np.concatenate([take.readings for take in session.takes])
    reference = np.concatenate([take.reference for take in session.takes])
    for column, rotation in enumerate(session.plan.rotations):
        fit = np.polynomial.Polynomial.fit(readings[:, column], reference[:, column], 9)
        error = np.sqrt(np.mean((fit(readings[:, column]) - reference[:, column]) ** 2))
        assert error == pytest.approx(session.floor_deg[rotation], rel=0.12)


@pytest.mark.parametrize("seed", range(6))
def test_sensor_curves_are_mild_and_rise_everywhere(seed):
    glove = SessionGlove(SessionPlan(seed=seed))
    angles = np.linspace(-40.0, 130.0, 341)[:, None] * np.ones(5)
    slope = glove.slope(angles)
    assert slope.min() > 0.7
    assert slope.max() < 1.4
    assert np.abs(np.diff(slope, axis=0)).max() < 0.3, "no jumps"


@pytest.mark.parametrize("nuisance", ["drift", "posture"])
def test_what_a_healthy_glove_leaves_has_its_size(nuisance):
    plan = SessionPlan(seed=2, nuisance=nuisance)
    glove = SessionGlove(plan)
    left = glove.nuisance(play_scene(plan, schedule(plan), glove.zero / glove.gain))
    assert np.sqrt(np.mean(left**2)) == pytest.approx(plan.nuisance_deg, rel=0.2)


def test_takes_survive_a_file(tmp_path):
    plan = SessionPlan(seed=3, wearings=2, takes_per_wearing=1, take_s=6.0, motions=("poses",))
    takes = record_session(plan, [Cause("contact_pressure")]).takes
    (path,) = write_takes(takes, tmp_path / "session.csv")
    again = read_takes(path)
    for take, other in zip(takes, again, strict=True):
        assert (take.name, take.wearing, take.poses) == (other.name, other.wearing, other.poses)
        np.testing.assert_array_equal(take.readings, other.readings)
        np.testing.assert_allclose(take.reference, other.reference, atol=1e-4)
        np.testing.assert_allclose(take.context["contact_n"], other.context["contact_n"], atol=1e-4)


def test_sensors_remember_what_happened_before_the_take():
    plan = SessionPlan(seed=9, motions=("still",), takes_per_wearing=3, take_s=30.0, bits=12)
    natural = record_session(SessionPlan(seed=9), [Cause("creep", "two_exponentials", 3.0)])
    at_rest = natural.also("still", 30.0, wearing=0)
    change = (at_rest.take.readings - at_rest.clean.readings) / SessionGlove(natural.plan).gain
    assert np.abs(change[:60].mean(axis=0) - change[-60:].mean(axis=0)).max() > 0.5
    assert record_session(plan, [Cause("lag", "one_pole")]).causes[0].reached_deg["I_MCP"] < 0.5


def test_natural_motion_has_the_speed_of_everyday_use_and_rests():
    session = record_session(SessionPlan(seed=2))
    assert 30 < np.mean([speed_deg_s(truth, 60.0) for truth in session.truth]) < 55
    moved = np.concatenate([np.abs(truth[12:] - truth[:-12]).max(axis=1) for truth in session.truth])
    assert 0.1 < (moved < 1.5).mean() < 0.5, "within a fifth of a second nothing but wander and tremor"


def test_motions_differ_as_their_names_say():
    session = record_session(SessionPlan(seed=6, wearings=1, takes_per_wearing=8, motions=TAKE_MOTIONS))
    truth = dict(zip(TAKE_MOTIONS, session.truth, strict=True))
    take = dict(zip(TAKE_MOTIONS, session.takes, strict=True))
    speed = {motion: speed_deg_s(angles, 60.0) for motion, angles in truth.items()}
    assert speed["fast"] > 4 * speed["natural"] > 4 * speed["holds"]
    assert speed["still"] == 0
    assert {name for name in take["poses"].poses or () if name} == {
        "flat",
        "spread",
        "fist",
        "overbend",
        "thumb_up",
    }
    assert take["natural"].poses is None
    moving = np.abs(truth["one_finger"][15:] - truth["one_finger"][:-15]) > 5
    index, middle = moving[:, :2].any(axis=1), moving[:, 2:4].any(axis=1)
    assert index.any()
    assert middle.any()
    assert (index & middle).mean() < 0.1 * index.mean()
    held = truth["ramps"][-19 * 60 :]
    assert (np.abs(np.diff(held, axis=0)).max(axis=1) * 60 < 25).mean() > 0.85


def test_a_palm_is_cupped_while_the_fingers_keep_still():
    sensors = ("I_MCP", "I_PIP", "PALM_ARCH")
    plan = SessionPlan(seed=6, sensors=sensors, wearings=1, takes_per_wearing=2, motions=("palm", "natural"))
    truth = record_session(plan).truth
    speed = [np.abs(np.diff(angles, axis=0)).mean(axis=0) for angles in truth]
    assert np.ptp(truth[0][:, 2]) > 12
    assert np.all(speed[0][:2] < 0.4 * speed[1][:2])


def test_fast_oscillation_lies_between_2_and_3_5_hz():
    truth = record_session(SessionPlan(seed=6, wearings=1, takes_per_wearing=1, motions=("fast",))).truth[0]
    size = np.abs(np.fft.rfft(truth[120:-120] - truth[120:-120].mean(axis=0), axis=0))
    peak_hz = np.fft.rfftfreq(len(truth) - 240, 1 / 60)[size.argmax(axis=0)]
    assert np.all((peak_hz > 1.8) & (peak_hz < 3.7))


def test_crossed_sessions_are_crossed_and_confounded_ones_are_not():
    def circumstances(confounded: bool) -> tuple[np.ndarray, np.ndarray]:
        takes = record_session(SessionPlan(seed=8, take_s=6.0, confounded=confounded)).takes
        power, supply = (
            [float(take.context[name][0]) for take in takes] for name in ("power_on_s", "supply_v")
        )
        return np.array(power), np.array(supply)

    power, supply = circumstances(False)
    restarted = np.flatnonzero(np.diff(power) < 0) + 1
    changed = np.flatnonzero(np.diff(supply) > 0.06) + 1
    assert len(restarted) >= 2
    assert len(changed) >= 1
    assert set(restarted) - {4, 8}, "power was switched inside a wearing too"
    assert not set(changed) & set(restarted)
    power, supply = circumstances(True)
    assert np.all(np.diff(power) > 0)
    assert np.corrcoef(power, supply)[0, 1] < -0.9


def test_one_more_take_is_of_the_same_glove_with_the_same_causes():
    session = record_session(SHORT, CAUSES)
    more = session.also("fast", 8.0, wearing=1)
    assert same(more.take, session.also("fast", 8.0, wearing=1).take)
    assert not same(more.take, session.also("fast", 8.0, wearing=1, repeat=1).take)
    assert more.take.wearing == "wearing-2"
    assert more.truth.shape == (480, 5)
    assert session.also("still", 8.0, wearing=2).take.wearing == "wearing-3"
    shift = [
        (take.readings - clean.readings).mean(axis=0)
        for take, clean in ((session.takes[2], session.clean[2]), (more.take, more.clean))
    ]
    assert np.corrcoef(shift[0], shift[1])[0, 1] > 0.8, "the wearing's shift is that of the session"


def test_other_air_is_felt_in_minutes_and_keeps_its_water():
    time = np.array([-1e6, 0.0, 1e6])
    cooled = AirChange(warmer_c=-10.0, damper_pct=0.0, lasts_s=1e6)
    temperature, humidity = cooled.felt(np.full(3, 30.0), np.full(3, 50.0), time)
    assert temperature == pytest.approx([30.0, 20.0, 30.0])
    # Saturated at 30 degrees Celsius air holds 42.47 hPa of water, at 20 degrees 23.39 hPa (CRC Handbook).
    assert humidity == pytest.approx([50.0, 50.0 * 42.47 / 23.39, 50.0], rel=0.01)
    bag = AirChange(warmer_c=0.0, damper_pct=80.0, lasts_s=1e6)
    assert bag.felt(np.full(3, 30.0), np.full(3, 50.0), time)[1].max() < 100.0


@pytest.mark.parametrize("asked", [("dance", 8.0, 0), ("fast", 1.0, 0), ("fast", 8.0, -1)])
def test_one_more_take_that_cannot_be_recorded_is_refused(asked):
    with pytest.raises(BadInput):
        record_session(SHORT).also(*asked)


def test_a_reference_with_its_own_clock_and_frames_off_the_beat():
    plan = SessionPlan(
        seed=3, wearings=1, takes_per_wearing=1, take_s=12.0, reference_clock="own", frame_jitter_s=0.004
    )
    session = record_session(plan, [Cause("clock_offset", "constant", 1.0)])
    take = session.takes[0]
    assert take.has_own_reference_clock
    assert len(take.reference) == pytest.approx(1200, abs=1)
    assert np.diff(take.time_s).std() > 0.003
    seen = session.clean[0].reference_at_frames(plan.rotations) - session.truth[0]
    assert 0.3 < np.nanstd(seen) < 1.0


def test_the_whole_cyberglove_and_a_glove_that_is_no_hand():
    whole = record_session(
        SessionPlan.of_layout("cyberglove18", seed=2, wearings=1, takes_per_wearing=2, take_s=10.0)
    )
    assert whole.takes[0].readings.shape == (600, 18)
    assert whole.truth[0].shape == (600, 23)
    assert "PALM_ARCH" not in whole.takes[0].rotations
    assert whole.floor_deg.keys() == set(whole.plan.sensors)
    ankle = record_session(SessionPlan(sensors=("toe", "heel", "calf", "shin"), take_s=10.0))
    assert ankle.takes[0].rotations == ("toe", "heel", "calf", "shin")
    assert np.concatenate(ankle.truth).std(axis=0).min() > 5


@pytest.mark.parametrize(
    "choices",
    [
        {"wearings": 0}, {"take_s": 1.0}, {"sensors": ("A", "A")}, {"motions": ("dance",)},
        {"motions": ("fast", "still", "fast")}, {"rotations": ("I_MCP",)},
    ],
)  # fmt: skip
def test_plans_that_cannot_be_recorded_are_refused(choices):
    with pytest.raises(BadInput):
        SessionPlan(**choices)
