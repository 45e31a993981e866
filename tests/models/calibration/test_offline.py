"""Estimates with both directions of time: their laws, what they claim, and a lag that is led back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.calibration import motion_smoother
from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.motion_smoother import smoothed
from glovecal_models.calibration.offline import LEAD, OfflinePredictor, leads_of
from glovecal_models.calibration.predictor import GloveAngles, GlovePredictor
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.comparison.compare import compare
from glovecal_models.improvement.add_effect import add_effect
from glovecal_models.layout import Layout
from glovecal_models.presentation.document import Chart
from glovecal_models.presentation.drawing import svg
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import RecordedSession, record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take

SENSORS = ("I_MCP", "I_PIP")
RATE_HZ = 60.0
SETTINGS = TrainingSettings(folds=2, samples=400)
HALF_95 = 1.959964


def moving(frames: int, joints: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Times (N,) and smooth angles (N, L), degrees."""
    random = np.random.default_rng(seed)
    time_s = np.arange(frames) / RATE_HZ
    speed_hz, phase = random.uniform(0.1, 0.8, (4, joints)), random.uniform(0, 6, (4, joints))
    return time_s, 10 * np.sin(2 * np.pi * speed_hz * time_s[:, None, None] + phase).sum(axis=1)


def angles_of(model: CalibrationModel, take: Take, *, offline: bool) -> GloveAngles:
    predictor = OfflinePredictor(model) if offline else GlovePredictor(model)
    return predictor.predict_take(take.time_s, take.readings, take.context, take.wearing)


def test_a_still_hands_deviation_falls_with_the_root_of_the_frames() -> None:
    random = np.random.default_rng(1)
    spread = {}
    for frames in (32, 128, 512):
        noise = random.standard_normal((frames, 100))
        found = smoothed(np.arange(frames) / RATE_HZ, noise)
        angle = found.state[:, :, 0]
        spread[frames] = float(np.sqrt(np.mean(angle**2)))
        claimed = float(np.sqrt(np.mean(found.covariance[:, :, 0, 0])))
        assert claimed == pytest.approx(spread[frames], rel=0.25)
    assert spread[32] / spread[128] == pytest.approx(2.0, rel=0.25)
    # Over eight seconds the longest time that is tried decides, no longer the take.
    assert spread[128] / spread[512] < 2.0
    assert spread[512] < 0.16


def test_a_film_backwards_gives_the_same_backwards() -> None:
    time_s, truth = moving(600, 6, 2)
    noisy = truth + 0.5 * np.random.default_rng(2).standard_normal(truth.shape)
    forward, back = smoothed(time_s, noisy), smoothed(time_s, noisy[::-1])
    np.testing.assert_allclose(back.state[::-1, :, 0], forward.state[:, :, 0], atol=1e-3)
    np.testing.assert_allclose(back.state[::-1, :, 1], -forward.state[:, :, 1], atol=1e-1)
    np.testing.assert_allclose(back.covariance[::-1, :, 0, 0], forward.covariance[:, :, 0, 0], rtol=1e-2)


def test_motion_is_freed_of_noise_and_the_claim_covers_what_is_left() -> None:
    time_s, truth = moving(1800, 8, 3)
    noise = np.random.default_rng(3).standard_normal(truth.shape)
    found = smoothed(time_s, truth + noise)
    error = found.state[:, :, 0] - truth
    assert np.sqrt(np.mean(error**2)) < 0.35
    assert found.noise.mean() == pytest.approx(1.0, rel=0.1)
    inside = np.abs(error) <= HALF_95 * np.sqrt(found.covariance[:, :, 0, 0])
    assert 0.9 < inside.mean() < 0.99


def test_unknown_frames_are_bridged_and_claimed_to_be_less_certain() -> None:
    time_s, truth = moving(600, 3, 4)
    noisy = truth + 0.3 * np.random.default_rng(4).standard_normal(truth.shape)
    known = np.ones(truth.shape, bool)
    known[300:312, 1] = False
    found = smoothed(time_s, np.where(known, noisy, 1e3), known)
    assert np.abs(found.state[300:312, 1, 0] - truth[300:312, 1]).max() < 3.0
    sd = np.sqrt(found.covariance[:, 1, 0, 0])
    assert sd[306] > 1.5 * sd[200]


def test_long_recordings_are_smoothed_in_pieces_without_a_seam(monkeypatch: pytest.MonkeyPatch) -> None:
    time_s, truth = moving(1800, 2, 5)
    noisy = truth + 0.5 * np.random.default_rng(5).standard_normal(truth.shape)
    whole = smoothed(time_s, noisy)
    monkeypatch.setattr(motion_smoother, "PIECE_FRAMES", 600)
    pieces = smoothed(time_s, noisy)
    np.testing.assert_allclose(pieces.state[:, :, 0], whole.state[:, :, 0], atol=0.3)
    step = np.abs(np.diff(pieces.state[:, :, 0], axis=0) - np.diff(whole.state[:, :, 0], axis=0))
    assert step.max() < 0.1
    apart = np.concatenate([time_s[:500], time_s[500:1000] + 60.0])
    alone = smoothed(time_s[:500], noisy[:500])
    np.testing.assert_allclose(smoothed(apart, noisy[:1000]).state[:500], alone.state, atol=1e-9)


def session_of(*causes: Cause, noise_deg: float = 0.5) -> RecordedSession:
    plan = SessionPlan(
        seed=31, sensors=SENSORS, bits=12, nuisance="white", wearings=1, takes_per_wearing=6, take_s=25.0,
        sensor_noise_deg=noise_deg,
    )  # fmt: skip
    return record_session(plan, causes)


def trained(session: RecordedSession) -> CalibrationModel:
    return train(session.takes[:5], Layout.from_columns("two", SENSORS, SENSORS), "simulated", SETTINGS)


@pytest.fixture(scope="module")
def clean() -> RecordedSession:
    return session_of()


@pytest.fixture(scope="module")
def model(clean: RecordedSession) -> CalibrationModel:
    return trained(clean)


def test_a_healthy_glove_is_better_offline_and_its_claim_covers(
    clean: RecordedSession, model: CalibrationModel
) -> None:
    take, truth = clean.takes[5], clean.truth[5]
    live, offline = (angles_of(model, take, offline=each) for each in (False, True))
    errors = [float(np.sqrt(np.mean((angles.mean - truth) ** 2))) for angles in (live, offline)]
    assert errors[1] < 0.6 * errors[0]
    assert (offline.sd < live.sd).mean() > 0.99
    inside = np.abs(offline.mean - take.reference_at_frames(SENSORS)) <= HALF_95 * offline.sd
    assert 0.92 <= inside.mean() <= 0.98
    np.testing.assert_array_equal(offline.flags, live.flags)
    backwards = replace(take, readings=take.readings[::-1])
    np.testing.assert_allclose(angles_of(model, backwards, offline=True).mean[::-1], offline.mean, atol=2e-2)
    nothing = take.readings[:0]
    assert OfflinePredictor(model).predict_take(np.empty(0), nothing, {}, "").mean.shape == (0, 2)


def test_a_lag_is_led_back_by_the_smoothed_motion() -> None:
    session = session_of(Cause("lag", "one_pole", 3.0), noise_deg=0.3)
    late = add_effect(trained(session), session.takes[:5], "lag", settings=SETTINGS, least_gain=-9).model
    leads = leads_of(late.effects)
    for name in SENSORS:
        assert leads[name].velocity_s == pytest.approx(session.causes[0].sizes[name], rel=0.15)
        assert leads[name].gain == pytest.approx(1.0, abs=0.05)
    take, truth = session.takes[5], session.truth[5]
    errors, inside = {}, {}
    for offline in (False, True):
        angles = angles_of(late, take, offline=offline)
        errors[offline] = float(np.sqrt(np.mean((angles.mean - truth) ** 2)))
        reference = take.reference_at_frames(SENSORS)
        inside[offline] = float(np.mean(np.abs(angles.mean - reference) <= HALF_95 * angles.sd))
    assert errors[True] < 0.5 * errors[False]
    assert 0.9 <= inside[True] <= 0.985
    again = load(dump(late))
    assert leads_of(again.effects) == leads
    # Stored before leads were learned: its live correction is smoothed as it is.
    [item] = late.effects
    without = {key: value for key, value in item.settings.items() if key != LEAD}
    before = replace(late, effects=(replace(item, settings=without),))
    old = float(np.sqrt(np.mean((angles_of(before, take, offline=True).mean - truth) ** 2)))
    assert errors[True] < old < 1.05 * errors[False]
    found = compare(late, [take], offline=True)
    assert found.live is not None
    assert found.overall.rmse_deg < found.live.rmse_deg == compare(late, [take]).overall.rmse_deg
    assert f"live {found.live.rmse_deg:.2f}" in found.presentation().summary[1].text
    filtered, *delayed = [item.rmse_deg for item in found.delayed]
    assert found.live.rmse_deg > 1.1 * delayed[0] > 1.1 * delayed[-1]
    assert filtered > delayed[0]
    assert delayed[-1] == pytest.approx(found.overall.rmse_deg, rel=0.03)
    [section] = [item for item in found.sections if item.heading == "What a delay would buy"]
    [chart] = section.parts
    assert isinstance(chart, Chart)
    assert svg(chart).count("200 ms") == 1
    assert not [
        item for item in compare(late, [take]).sections if item.heading == section.heading and item.parts
    ]
