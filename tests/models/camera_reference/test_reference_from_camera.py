"""A camera's estimates as a take's reference: its clock, its gaps, its ranges."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from simulated_camera import CALIBRATED, SimulatedCamera, lasting_noise

from glovecal_models.errors import BadInput
from glovecal_models.simulation.session import RecordedSession, record_session
from glovecal_models.simulation.session_plan import SessionPlan, TakeMotion
from glovecal_models.takes.camera_estimates import ALIKE_S, CameraEstimates, covered_ranges, thinned
from glovecal_models.takes.camera_reference import CAMERA_PATCHES, camera_clock, reference_from_camera
from glovecal_models.takes.take import Take


@cache
def session(seed: int, motion: TakeMotion = "fast") -> RecordedSession:
    plan = SessionPlan(
        seed=seed, wearings=1, takes_per_wearing=1, take_s=30.0, rate_hz=100.0, motions=(motion,)
    )
    return record_session(plan)


def noisy(seed: int, offset_s: float, sd_deg: float = 6.0) -> tuple[Take, CameraEstimates]:
    """Everything accepted at 30 Hz, with errors that last for 0.3 s."""
    take, truth = session(seed).takes[0], session(seed).truth[0]
    at = np.arange(0.01, 30.0, 1 / 30)
    angles = np.column_stack([np.interp(at, take.time_s, column) for column in truth.T])
    angles += sd_deg * lasting_noise(at, angles.shape[1], 0.15, np.random.default_rng(seed))
    return take, CameraEstimates(
        at + offset_s, take.sensors, angles, np.full_like(angles, sd_deg), np.ones(angles.shape, bool),
        np.full(len(at), 12), simulated=True,
    )  # fmt: skip


def test_the_offset_is_found_within_its_standard_deviation():
    errors, stated = [], []
    for seed in range(8):
        take, estimates = noisy(seed, 0.1 * (seed - 4) + 0.003)
        clock = camera_clock(take, estimates)
        errors.append(clock.offset_s - 0.1 * (seed - 4) - 0.003)
        stated.append(clock.sd_s)
    assert np.abs(errors).max() < 0.005
    assert np.sqrt(np.mean(np.square(errors))) < 2.0 * np.mean(stated) < 0.004


def test_the_offset_moves_with_the_stamps_and_with_nothing_else():
    take, estimates = noisy(3, 0.2)
    first = camera_clock(take, estimates)
    later = camera_clock(take, replace(estimates, time_s=estimates.time_s + 0.5))
    assert later.offset_s - first.offset_s == pytest.approx(0.5, abs=1e-3)
    other_units = replace(take, readings=40.0 - 3.0 * take.readings)
    assert camera_clock(other_units, estimates).offset_s == pytest.approx(first.offset_s, abs=1e-6)


def test_a_clock_that_cannot_be_found_is_refused():
    take, estimates = noisy(1, 0.0)
    _, other = noisy(2, 0.0)
    with pytest.raises(BadInput, match="was not found within 3 s"):
        camera_clock(take, other)
    still = replace(estimates, angles_deg=np.full_like(estimates.angles_deg, 20.0))
    with pytest.raises(BadInput, match="cannot be found; no rotation that it accepts moves"):
        camera_clock(take, still)
    with pytest.raises(BadInput, match=r"was not found within 0\.2 s"):
        camera_clock(take, replace(estimates, time_s=estimates.time_s + 1.0), within_s=0.2)


def test_only_what_was_accepted_becomes_the_reference_on_the_gloves_clock():
    take, truth = session(5, "natural").takes[0], session(5, "natural").truth[0]
    estimates = replace(CALIBRATED, offset_s=0.3).see(take.time_s, truth, take.sensors, seed=5)
    found = reference_from_camera(take, estimates)
    assert found.clock.offset_s == pytest.approx(0.3, abs=0.01)
    seen = found.take
    rows = np.isin(np.round(estimates.time_s - found.clock.offset_s, 9), np.round(seen.reference_time_s, 9))
    np.testing.assert_array_equal(np.isfinite(seen.reference), estimates.accepted[rows])
    assert seen.reference_sd is not None
    np.testing.assert_array_equal(np.isfinite(seen.reference_sd), estimates.accepted[rows])
    assert seen.simulated
    assert CAMERA_PATCHES in seen.context
    at_frames = seen.reference_at_frames(seen.rotations)
    error = (at_frames - truth)[np.isfinite(at_frames)]
    stated = seen.reference_sd_at_frames(seen.rotations)
    assert stated is not None
    assert np.sqrt(np.mean(error**2)) == pytest.approx(np.sqrt(np.nanmean(stated**2)), rel=0.35)
    document = found.to_document()
    assert document["clock_offset_s"] == pytest.approx(0.3, abs=0.01)
    assert {item["rotation"] for item in document["ranges"]} == set(seen.rotations)
    assert "of its estimates are accepted" in found.sentences()[0]


def test_a_rotation_whose_deep_flexion_was_never_seen_says_so():
    take, truth = session(5, "natural").takes[0], session(5, "natural").truth[0]
    estimates = CALIBRATED.see(take.time_s, truth, take.sensors, seed=5)
    accepted = estimates.accepted & (estimates.angles_deg < 35.0)
    found = reference_from_camera(take, replace(estimates, accepted=accepted))
    of_pip = next(item for item in found.ranges if item.rotation == "I_PIP")
    assert of_pip.high_deg < 35.0
    assert "It never saw deep flexion (" in of_pip.sentence
    assert list(of_pip.holds(np.array([-90.0, of_pip.low_deg, 60.0]))) == [False, True, False]


def test_nothing_accepted_is_no_reference():
    take, estimates = noisy(1, 0.0)
    nothing = replace(estimates, accepted=np.zeros_like(estimates.accepted))
    with pytest.raises(BadInput, match="accepted no angle"):
        reference_from_camera(take, nothing)


def test_samples_are_thinned_to_those_whose_errors_differ():
    time = np.arange(0, 3, 0.01)
    rows = np.flatnonzero((time < 1) | (time > 2))
    kept = thinned(time, rows)
    assert np.diff(time[kept]).min() >= ALIKE_S - 1e-9
    assert len(kept) == 8
    assert set(kept) <= set(rows.tolist())
    assert len(thinned(time, np.array([], dtype=int))) == 0


def test_takes_without_stated_deviations_have_no_range():
    assert covered_ranges([session(1).takes[0]], ["I_MCP"]) == ()


def test_simulated_errors_are_as_large_as_stated():
    take, truth = session(7, "natural").takes[0], session(7, "natural").truth[0]
    for camera, times, hands in ((CALIBRATED, 1.0, 6), (SimulatedCamera(), 0.81, 24)):
        scores = []
        for seed in range(hands):
            seen = replace(camera, offset_s=0.0, hand=seed).see(take.time_s, truth, take.sensors, seed)
            true = np.column_stack([np.interp(seen.time_s, take.time_s, column) for column in truth.T])
            scores.append(((seen.angles_deg - true) / seen.sd_deg).ravel())
        assert np.std(np.concatenate(scores)) == pytest.approx(times, rel=0.12)
