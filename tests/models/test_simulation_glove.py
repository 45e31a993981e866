"""The simulated glove: its couplings have the sizes of the paper, its counts those of real gloves."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.layout import Layout
from glovecal_models.simulation.simulated_glove import Cloth, SimulatedGlove
from glovecal_models.simulation.simulated_hand import (
    DRIVEN,
    POSTURES,
    ROTATIONS,
    TABLE_1,
    TOGETHER,
    SimulatedHand,
)
from glovecal_models.typical_counts import raw_angles

LAYOUT = Layout.built_in("cyberglove18")
FLEXION = [name for name in LAYOUT.sensors if name.endswith(("_MCP", "_PIP", "_IP"))]
GAPS = ["IM_ABD", "MR_ABD", "RP_ABD"]


def posture(name: str) -> np.ndarray:
    driven = {rotation: np.array([angle]) for rotation, angle in POSTURES[name].items()}
    return SimulatedHand(0).complete(driven)


def still(count: int) -> np.ndarray:
    """All rotations at 0, so that only what a test moves can move a sensor."""
    return np.zeros((count, len(ROTATIONS)))


def swept(rotation: str, share: np.ndarray) -> np.ndarray:
    low, high = ACTIVE_RANGE_DEG[rotation]
    return low + (high - low) * share


def per_cent(sensor: str, angles: np.ndarray) -> tuple[float, float]:
    """Standard and largest deviation of a sensor's strain, in % of its active range, as in Table 1."""
    strain = Cloth(LAYOUT.sensors, ROTATIONS).strain(angles)[:, LAYOUT.sensors.index(sensor)]
    low, high = ACTIVE_RANGE_DEG[sensor]
    off = 100 * (strain - strain.mean()) / (high - low)
    return float(off.std()), float(np.abs(off).max())


PAIRS = [(sensor, neighbour) for sensor, row in TABLE_1.items() for neighbour in row]


@pytest.mark.parametrize(("sensor", "neighbour"), PAIRS)
def test_one_neighbour_disturbs_a_sensor_as_much_as_in_table_1(sensor, neighbour):
    share = np.linspace(0, 1, 501)
    angles = still(len(share))
    angles[:, ROTATIONS.index(neighbour)] = swept(neighbour, share)
    standard, largest = per_cent(sensor, angles)
    assert standard == pytest.approx(TABLE_1[sensor][neighbour][0], rel=0.3)
    assert largest == pytest.approx(TABLE_1[sensor][neighbour][1], rel=0.3)


@pytest.mark.parametrize("sensor", GAPS)
def test_both_neighbours_together_disturb_as_much_as_in_table_1(sensor):
    first, second = np.meshgrid(np.linspace(0, 1, 61), np.linspace(0, 1, 61))
    angles = still(first.size)
    for neighbour, share in zip(TABLE_1[sensor], (first, second), strict=True):
        angles[:, ROTATIONS.index(neighbour)] = swept(neighbour, share.ravel())
    standard, largest = per_cent(sensor, angles)
    assert standard == pytest.approx(TOGETHER[sensor][0], rel=0.3)
    assert largest == pytest.approx(TOGETHER[sensor][1], rel=0.3)


def test_pip_sensors_stay_below_the_threshold_that_table_1_calls_independent():
    share = np.linspace(0, 1, 201)
    for finger in "IMRP":
        angles = still(len(share))
        angles[:, ROTATIONS.index(f"{finger}_MCP")] = swept(f"{finger}_MCP", share)
        standard, largest = per_cent(f"{finger}_PIP", angles)
        assert standard < 5
        assert largest < 12


@pytest.mark.parametrize("sensor", GAPS)
def test_no_linear_map_undoes_the_coupling(sensor):
    random = np.random.default_rng(3)
    neighbours = list(TABLE_1[sensor])
    angles = still(2000)
    for name in (sensor, *neighbours):
        angles[:, ROTATIONS.index(name)] = swept(name, random.random(2000))
    strain = Cloth(LAYOUT.sensors, ROTATIONS).strain(angles)
    inputs = strain[:, [LAYOUT.sensors.index(name) for name in (sensor, *neighbours)]]
    target = angles[:, ROTATIONS.index(sensor)]
    plane = np.column_stack([inputs, np.ones(len(inputs))])
    left = target - plane @ np.linalg.lstsq(plane, target, rcond=None)[0]
    assert np.sqrt(np.mean(left**2)) > 2.0  # degrees, without any noise


@pytest.mark.parametrize("layout", ["cyberglove18", "cyberglove22"])
def test_readings_are_whole_counts_of_the_hardware(layout):
    glove = SimulatedGlove(5, layout)
    readings = glove.readings(np.concatenate([posture(name) for name in POSTURES]))
    assert readings.shape == (len(POSTURES), len(glove.sensors))
    assert (readings == np.rint(readings)).all()
    assert readings.min() >= 1
    assert readings.max() <= 255


def test_same_seed_is_the_same_glove_frame_by_frame_or_all_at_once():
    angles = np.concatenate([posture(name) for name in POSTURES])
    whole = SimulatedGlove(7).readings(angles)
    stepwise = SimulatedGlove(7)
    np.testing.assert_array_equal(whole, np.concatenate([stepwise.readings(row[None]) for row in angles]))
    assert (SimulatedGlove(8).readings(angles) != whole).mean() > 0.8


def test_putting_the_glove_on_again_shifts_readings_by_about_a_degree():
    angles = np.repeat(posture("rest"), 400, axis=0)
    gains = np.array([np.abs(_gain(name)) for name in LAYOUT.sensors])
    shifts = []
    for seed in range(6):
        first, second = (SimulatedGlove(seed, wearing=w).readings(angles).mean(axis=0) for w in (0, 1))
        shifts.append((second - first) / gains)
    assert 0.3 < np.std(shifts) < 2.0


def _gain(sensor: str) -> float:
    from glovecal_models.typical_counts import TYPICAL_COUNTS

    return TYPICAL_COUNTS[sensor][1]


def test_a_still_hand_reads_with_about_the_noise_kessler_found():
    readings = SimulatedGlove(1).readings(np.repeat(posture("rest"), 3000, axis=0))
    noise = readings.std(axis=0) / np.abs([_gain(name) for name in LAYOUT.sensors])
    assert noise.mean() == pytest.approx(1.1, abs=0.3)  # degrees; Kessler et al. 1995: 1.1


def test_counts_go_the_way_of_real_gloves():
    gloves = [SimulatedGlove(seed) for seed in range(5)]
    sensors = LAYOUT.sensors

    def mean_counts(pose: str, names: list[str]) -> np.ndarray:
        columns = [sensors.index(name) for name in names]
        angles = np.repeat(posture(pose), 50, axis=0)
        return np.array([glove.readings(angles).mean(axis=0)[columns] for glove in gloves])

    flat, fist, spread = (mean_counts(pose, FLEXION) for pose in ("flat", "fist", "spread"))
    assert (fist > flat).all()
    assert 32 <= np.median(flat) <= 118  # straight hand, public calibration files
    assert 72 <= np.median(fist) <= 232
    assert (mean_counts("spread", GAPS) < mean_counts("flat", GAPS)).all()
    np.testing.assert_allclose(spread, flat, atol=20)


def test_uncalibrated_angles_undo_a_typical_glove_and_follow_the_rules():
    readings = np.array([[_zero(name) + 10 * _gain(name) for name in LAYOUT.sensors]])
    angles = dict(zip(LAYOUT.rotations, raw_angles(LAYOUT, readings)[0], strict=True))
    assert all(angle == pytest.approx(10) for name, angle in angles.items() if not name.endswith("_DIP"))
    assert angles["I_DIP"] == pytest.approx(20 / 3)
    assert np.isnan(raw_angles(Layout.built_in("lucidglove"), np.zeros((2, 5)))).all()


def _zero(sensor: str) -> float:
    from glovecal_models.typical_counts import TYPICAL_COUNTS

    return TYPICAL_COUNTS[sensor][0]


def test_last_joints_and_thumb_follow_the_papers_rules_with_personal_deviations():
    random = np.random.default_rng(0)
    driven = {name: swept(name, random.random(500)) for name in DRIVEN}
    for seed in range(4):
        angles = dict(zip(ROTATIONS, SimulatedHand(seed).complete(driven).T, strict=True))
        off = np.concatenate([angles[f"{f}_DIP"] - 2 / 3 * driven[f"{f}_PIP"] for f in "IMRP"])
        virtual = angles["T_VIR"] - 0.5 * driven["T_TMC"] - 0.5 * driven["TI_ABD"]
        assert 0.2 < np.sqrt(np.mean(off**2)) < 8
        assert 0.1 < np.sqrt(np.mean(virtual**2)) < 8


def test_what_cannot_be_simulated_is_refused():
    with pytest.raises(BadInput, match="cyberglove18, cyberglove22"):
        SimulatedGlove(0, "lucidglove")
    with pytest.raises(BadInput, match="counted from 0"):
        SimulatedGlove(-1)
    with pytest.raises(BadInput, match=r"expected \(N, 23\)"):
        SimulatedGlove(0).readings(np.zeros((3, 5)))
