"""The simulated hand's motion, the protocol and the takes recorded from it."""

from __future__ import annotations

from itertools import count, islice

import numpy as np
import pytest

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.simulation.protocol import (
    GAPS,
    MOTIONS,
    WIDGET_DEG,
    cross_couple_segment,
    evaluation_segment,
    free_segment,
    minimum_jerk,
    sampling_protocol,
    segments,
)
from glovecal_models.simulation.simulated_glove import Performance, SimulatedGlove, duration_s, simulate_take
from glovecal_models.simulation.simulated_hand import (
    DRIVEN,
    KEY_POSES,
    POSTURES,
    ROTATIONS,
    TABLE_3_POSES,
    SimulatedHand,
)
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.write_table import write_takes


def test_minimum_jerk_is_the_quintic_that_rests_at_both_ends():
    def row(x: float, order: int) -> list[float]:  # derivatives of 1, x ... x^5
        return [
            np.polynomial.polynomial.polyval(x, np.polynomial.polynomial.polyder(np.eye(6)[k], order))
            for k in range(6)
        ]

    ends = np.array([row(x, order) for x in (0.0, 1.0) for order in (0, 1, 2)])
    quintic = np.linalg.solve(ends, [0, 0, 0, 1, 0, 0])
    x = np.linspace(0, 1, 50)
    np.testing.assert_allclose(minimum_jerk(x), np.polynomial.polynomial.polyval(x, quintic), atol=1e-12)
    np.testing.assert_array_equal(minimum_jerk(np.array([-1.0, 2.0])), [0, 1])


@pytest.mark.parametrize("motion", MOTIONS)
def test_motion_is_smooth_and_stays_near_what_a_hand_can_do(motion):
    planned = segments(motion, 4)
    time = np.arange(0, duration_s(planned), 0.001)
    angles, poses = Performance(SimulatedHand(4), planned, DRIVEN).at(time)
    assert len(poses) == len(angles) == len(time)
    assert np.abs(np.diff(angles, axis=0)).max() < 1.5  # degrees in a millisecond: no jump anywhere
    low, high = np.array([ACTIVE_RANGE_DEG[name] for name in DRIVEN]).T
    assert (angles > low - 3).all()
    assert (angles < high + 3).all()


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_sampling_fits_a_demonstration_and_samples_what_the_paper_samples(seed):
    planned = sampling_protocol(seed)
    assert 35 <= duration_s(planned) <= 45
    names = [segment.name for segment in planned]
    assert names[0] == "key_poses"
    assert [f"cross_couple_{angle:.0f}" for angle in WIDGET_DEG] == names[1:5]
    time = np.arange(0, duration_s(planned), 1 / 120)
    angles, poses = Performance(SimulatedHand(seed), planned, ROTATIONS).at(time)
    assert set(KEY_POSES) <= set(poses)
    for name in DRIVEN:
        low, high = ACTIVE_RANGE_DEG[name]
        assert np.ptp(angles[:, ROTATIONS.index(name)]) > 0.7 * (high - low), name


def test_widgets_hold_the_gaps_still_while_fingers_bend():
    segment = cross_couple_segment(3, 20.0)
    driven = segment.driven(np.arange(0.5, segment.duration_s - 0.5, 0.01))
    held = driven[:, [DRIVEN.index(gap) for gap in GAPS]]
    np.testing.assert_allclose(held, 20.0, atol=1e-9)
    assert np.ptp(driven[:, DRIVEN.index("M_MCP")]) > 70


def test_evaluation_holds_each_of_the_nine_poses():
    segment = evaluation_segment(1)
    time = np.arange(0, segment.duration_s, 0.01)
    poses = np.array(segment.poses(time))
    driven = segment.driven(time)
    assert [name for name in dict.fromkeys(poses.tolist()) if name] == list(TABLE_3_POSES)
    for name in TABLE_3_POSES:
        held = driven[poses == name]
        assert held.std(axis=0).max() < 2
        off = held.mean(axis=0) - np.array([POSTURES[name][rotation] for rotation in DRIVEN])
        assert np.abs(off).max() < 15


def test_key_poses_show_every_joint_at_two_angles():
    for name in DRIVEN:
        assert np.ptp([POSTURES[pose][name] for pose in KEY_POSES]) > 10, name


def test_a_performance_is_a_function_of_time_and_may_be_endless():
    hand = SimulatedHand(2)

    def endless():
        return (free_segment(2, 3.0, part) for part in count())

    time = np.arange(0, 20, 0.01)
    whole, _ = Performance(hand, endless(), ROTATIONS).at(time)
    in_parts = Performance(hand, endless(), ROTATIONS)
    parts = [in_parts.at(time[start : start + 70])[0] for start in range(0, len(time), 70)]
    np.testing.assert_allclose(np.concatenate(parts), whole, atol=1e-12)
    first, again = islice(endless(), 2)
    assert not np.allclose(first.driven(time[:300]), again.driven(time[:300]))


def test_a_simulated_take_is_marked_and_its_reference_is_truth_with_the_stated_noise(tmp_path):
    glove = SimulatedGlove(1, wearing=2)
    recorded = simulate_take(glove, sampling_protocol(1), reference_noise_deg=0.8, name="sampling")
    take = recorded.take
    assert take.simulated
    assert take.wearing == "wearing-2"
    assert "PALM_ARCH" not in take.rotations
    assert len(take.rotations) == 22
    columns = [glove.rotations.index(name) for name in take.rotations]
    noise = take.reference - recorded.truth[:, columns]
    assert noise.std() == pytest.approx(0.8, rel=0.05)
    again = simulate_take(SimulatedGlove(1, wearing=2), sampling_protocol(1), reference_noise_deg=0.8).take
    np.testing.assert_array_equal(take.readings, again.readings)
    np.testing.assert_array_equal(take.reference, again.reference)
    (read,) = read_takes(write_takes([take], tmp_path / "sampling.csv")[0])
    assert read.simulated
    assert read.poses == take.poses
    np.testing.assert_array_equal(read.reference, take.reference)


def test_nothing_to_record_and_unknown_motions_are_refused():
    with pytest.raises(BadInput, match="nothing to record"):
        simulate_take(SimulatedGlove(0), [])
    with pytest.raises(BadInput, match="no motion 'dance'"):
        segments("dance", 0)
