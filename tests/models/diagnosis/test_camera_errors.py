"""A diagnosis by a camera: its errors are its own, an effect of the glove has to beat them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from simulated_camera import CALIBRATED

from glovecal_models.calibration.held_out import BaseProducts, Rows, held_out, with_precision
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.resampled import resampled, shifted, smoothed
from glovecal_models.diagnosis.text import diagnosis_sentences
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import RecordedSession, record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.camera_reference import CAMERA_PATCHES, reference_from_camera
from glovecal_models.takes.take import Take

SENSORS = ("I_MCP", "M_MCP")
LAYOUT = Layout.from_columns("two", SENSORS, SENSORS)


@cache
def session(effect: str = "", seed: int = 11) -> RecordedSession:
    plan = SessionPlan(seed=seed, sensors=SENSORS, wearings=2, takes_per_wearing=2, take_s=45.0)
    return record_session(plan, [Cause(effect, strength_deg=2.0)] if effect else [])


@cache
def seen(effect: str = "", lean: float = 0.5, *, visibility_deg: float = 0.0) -> tuple[Take, ...]:
    """With ``visibility_deg`` the camera is wrong by so much while it sees few patches, and does not say
    so."""
    found = []
    for number, (take, truth) in enumerate(zip(session(effect).takes, session(effect).truth, strict=True)):
        estimates = replace(CALIBRATED, lean=lean).see(take.time_s, truth, take.sensors, seed=number)
        few = np.clip((14.5 - estimates.patches) / 3.0, 0.0, 1.0)[:, None]
        estimates = replace(estimates, angles_deg=estimates.angles_deg + visibility_deg * few)
        found.append(reference_from_camera(take, estimates).take)
    return tuple(found)


@cache
def diagnosed(effect: str = "", lean: float = 0.5, visibility_deg: float = 0.0) -> Diagnosis:
    return diagnose(seen(effect, lean, visibility_deg=visibility_deg), LAYOUT)


def test_an_effect_of_the_glove_is_named_by_a_camera():
    found = diagnosed("hysteresis")
    assert found.named is not None
    assert found.named.effect == "hysteresis"
    assert found.camera is not None
    assert set(found.camera.stated_deg) == set(SENSORS)
    assert all(0.5 < value < 2.5 for value in found.camera.stated_deg.values())


def test_a_clean_glove_is_not_blamed_for_the_cameras_errors():
    found = diagnosed()
    assert found.named is None
    assert not found.residual.is_significant


def test_an_error_that_goes_with_visibility_is_called_the_cameras_first_of_all():
    found = diagnosed("", 0.0, 5.0)
    assert found.camera is not None
    assert found.camera.joints
    assert found.named is None
    said = diagnosis_sentences(found)
    assert "it is the camera's, not the glove's" in said[0]
    assert any("other angles are not judged" in sentence for sentence in said)


def test_visibility_is_no_cause_of_the_glove():
    for item in diagnosed("", 0.0, 5.0).assessments:
        assert CAMERA_PATCHES not in item.effect


def test_takes_without_stated_deviations_have_no_camera():
    found = diagnose(session().takes, LAYOUT, signatures=False, judge_residual=False)
    assert found.camera is None


def test_floors_are_never_below_what_the_camera_states():
    found = diagnosed("hysteresis")
    assert found.camera is not None
    for name, floor in found.noise_floors.items():
        assert floor.reference_deg is not None
        assert floor.floor_deg >= floor.reference_deg
        assert floor.reference_deg == pytest.approx(found.camera.stated_deg[name], rel=0.1)


def test_nothing_is_drawn_across_what_was_not_accepted():
    take = seen()[0]
    even = resampled(take, SENSORS, SENSORS)
    assert even.reference_sd is not None
    accepted = np.isfinite(take.reference[:, 0])
    gap = int(np.flatnonzero(np.diff(accepted.astype(int)) == -1)[0])
    inside = (even.time_s > take.reference_time_s[gap]) & (even.time_s < take.reference_time_s[gap + 1])
    assert np.isnan(even.reference[inside, 0]).all()
    known = np.isfinite(even.reference)
    assert np.isfinite(even.reference_sd[known]).all()
    for other in (smoothed(even, 13), shifted(even, 0.02)):
        assert other.reference_sd is not None
        assert other.reference_sd.shape == even.reference_sd.shape


def rows(count: int = 400, units: int = 4) -> tuple[list[Rows], list[np.ndarray]]:
    random = np.random.default_rng(0)
    found, variances = [], []
    for _ in range(units):
        x = random.uniform(-1, 1, count)
        variance = random.uniform(0.1, 9.0, count)
        y = 3.0 * x + np.sqrt(variance) * random.standard_normal(count)
        found.append(Rows(np.column_stack([np.ones(count), x]), y))
        variances.append(variance)
    return found, variances


def test_equal_variances_leave_every_row_as_it_was():
    units, variances = rows()
    assert all(unit.weight is None for unit in with_precision(units, [np.full(400, 2.0)] * 4))
    assert all(unit.weight is None for unit in with_precision(units, [None] * 4))
    weighted = with_precision(units, variances)
    assert np.mean(np.concatenate([unit.weight for unit in weighted if unit.weight is not None])) == (
        pytest.approx(1.0)
    )


def test_weighted_rows_are_weighted_least_squares_on_held_out_units():
    units, variances = rows()
    weighted = with_precision(units, variances)
    products = BaseProducts(weighted)
    kept = weighted[1:]
    base = np.concatenate([unit.base for unit in kept])
    weight = np.concatenate([unit.weight for unit in kept if unit.weight is not None])
    target = np.concatenate([unit.target for unit in kept])
    coefficients = np.linalg.solve(base.T @ (weight[:, None] * base), base.T @ (weight * target))
    np.testing.assert_allclose(products.coefficients[0], coefficients, atol=1e-4)
    left = weighted[0].target - weighted[0].base @ products.coefficients[0]
    assert weighted[0].weight is not None
    assert products.error[0] == pytest.approx(np.sum(weighted[0].weight * left**2))
    columns = [np.sin(9.0 * unit.base[:, 1])[:, None, None] for unit in weighted]
    tried = held_out(products, columns, np.array([2.0]))
    np.testing.assert_allclose(tried.base, products.error)
    np.testing.assert_allclose(tried.added, [part @ part for part in tried.residual_added])
    assert abs(tried.weights[0]) < 0.3
