"""Wild rows of a reference are found, left out and told with their times; no row of a healthy take is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import glovecal
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan, TakeMotion
from glovecal_models.takes.reference_jumps import reference_jumps, without_jumps
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import check_take

SENSORS = ("I_MCP", "I_PIP", "M_PIP", "R_PIP")


def bent(seed: int, rate_hz: float = 60.0, seconds: float = 15.0) -> Take:
    """Four curved flex sensors with 12 counts of noise; neither tuned on nor simulated by the product."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1 / rate_hz)
    phases = random.uniform(0, 6, (4, 3))
    waves = np.sin(time[:, None, None] * np.array([0.7, 1.9, 4.1]) + phases) * [1.0, 0.7, 0.3]
    angles = 45 + 18 * waves.sum(axis=2)
    readings = 800 + 17 * angles + 0.05 * angles**2 + 12 * random.normal(size=angles.shape)
    noisy = angles + 0.5 * random.normal(size=angles.shape)
    return Take(f"t{seed}", "w", SENSORS, time, np.round(readings), SENSORS, time, noisy)


def with_wild_rows(take: Take, share: float, longest: int = 1) -> tuple[Take, np.ndarray]:
    """``share`` of the take's angles are wild, in runs of up to so many rows; and which (R, rotations)."""
    random = np.random.default_rng(len(take.time_s))
    wild = np.zeros(take.reference.shape, dtype=bool)
    reference = take.reference.copy()
    while wild.mean() < share:
        start, column = random.integers(1, len(wild) - longest - 1), random.integers(len(take.rotations))
        rows = slice(start, start + random.integers(1, longest + 1))
        if not wild[max(rows.start - 3, 0) : rows.stop + 3, column].any():
            wild[rows, column] = True
            reference[rows, column] += random.choice([-1, 1]) * random.uniform(30, 170)
    return replace(take, reference=reference), wild


@pytest.mark.parametrize("rate_hz", [30.0, 60.0, 120.0])
@pytest.mark.parametrize(("share", "longest"), [(0.012, 1), (0.03, 8)])
def test_wild_rows_are_left_out_and_no_others(rate_hz, share, longest):
    spoilt, wild = with_wild_rows(bent(3, rate_hz), share, longest)
    left = np.isnan(without_jumps(spoilt).reference)
    assert (left & wild).sum() >= 0.97 * wild.sum()
    assert not (left & ~wild).any()


def test_a_reference_with_a_clock_of_its_own():
    take = bent(4)
    spoilt, wild = with_wild_rows(replace(take, reference_time_s=take.reference_time_s + 0.004), 0.012)
    left = np.isnan(without_jumps(spoilt).reference)
    assert (left & wild).sum() >= 0.97 * wild.sum()
    assert not (left & ~wild).any()


def test_the_first_and_the_last_row():
    take = bent(5)
    reference = take.reference.copy()
    reference[0, 1], reference[-2:, 2] = 160.0, -120.0
    left = np.isnan(without_jumps(replace(take, reference=reference)).reference)
    assert sorted(zip(*np.nonzero(left), strict=True)) == [(0, 1), (898, 2), (899, 2)]


@pytest.mark.parametrize("motion", ["natural", "fast", "ramps", "holds", "one_finger", "poses"])
@pytest.mark.parametrize("rate_hz", [15.0, 60.0])
def test_no_row_of_a_healthy_take_is_left_out(motion: TakeMotion, rate_hz):
    plan = SessionPlan(
        seed=90, wearings=1, takes_per_wearing=1, take_s=20.0, rate_hz=rate_hz, motions=(motion,)
    )
    for causes in ((), (Cause("sensor_fault", strength_deg=6.0, channels=("I_PIP",)),)):
        [take] = record_session(plan, causes).takes
        assert without_jumps(take) is take


def test_angles_set_one_by_one_jump_and_stay_whole():
    take = bent(6)
    steps = np.repeat(np.tile([0.0, 60.0, 20.0, 90.0, 0.0], 36), 5)[:, None]
    assert without_jumps(replace(take, reference=np.repeat(steps, 4, axis=1))).excluded == ()


def test_a_step_that_stays_is_told_and_kept():
    take = bent(7)
    reference = take.reference.copy()
    reference[400:, 0] += 40.0
    stepped = replace(take, reference=reference)
    [jump] = reference_jumps(stepped)
    assert (jump.rotation, jump.comes_back) == ("I_MCP", False)
    assert jump.start_s == pytest.approx(take.time_s[400])
    assert without_jumps(stepped) is stepped
    assert "I_MCP steps by 4" in " ".join(check_take(stepped).sentences)


def test_a_check_lists_them_with_times_before_and_after_they_were_left_out():
    spoilt, wild = with_wild_rows(bent(8), 0.012)
    for take in (spoilt, without_jumps(spoilt)):
        found = check_take(take)
        assert sum(jump.rows for jump in found.jumps) >= 0.97 * wild.sum()
        assert all(wild[np.searchsorted(take.time_s, jump.start_s)].any() for jump in found.jumps)
        [sentence] = [each for each in found.sentences if "jump away and back" in each]
        assert f"{min(jump.start_s for jump in found.jumps):.2f}" in sentence


def test_a_model_is_as_good_as_without_wild_rows():
    clean = [bent(number, 30.0, 12.0) for number in range(3)]
    spoilt = [with_wild_rows(take, 0.012)[0] for take in clean]
    errors = [
        glovecal.train(takes, method="linear").inner.error_estimate["rmse_deg"] for takes in (clean, spoilt)
    ]
    assert errors[1] < 1.15 * errors[0]
