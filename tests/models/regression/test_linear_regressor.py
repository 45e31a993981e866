"""Linear calibration: the least-squares plane, its variance, degenerate samples, save and restore."""

import json

import numpy as np
import pytest
from sklearn.linear_model import LinearRegression

from glovecal_models.errors import BadInput, Cancelled, DamagedArtifact, NotTrainable
from glovecal_models.regression.linear_regressor import LinearRegressor, fit_linear


def samples(count: int = 200) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(0)
    inputs = generator.integers(20, 230, size=(count, 3)).astype(float)
    return inputs, inputs @ [0.4, -0.1, 0.05] - 12.0 + generator.normal(size=count)


def test_plane_is_scikit_learns_to_ten_digits() -> None:
    inputs, target = samples()
    theirs = LinearRegression().fit(inputs, target)
    assert fit_linear(inputs, target).predict(inputs).mean == pytest.approx(theirs.predict(inputs), rel=1e-10)


def test_variance_is_the_textbook_one_and_noise_is_unbiased() -> None:
    inputs, target = samples()
    regressor = fit_linear(inputs, target)
    basis = np.column_stack([inputs, np.ones(len(inputs))])
    residual = target - regressor.predict(inputs).mean
    noise = residual @ residual / (len(target) - 4)
    textbook = noise * np.einsum("nd,de,ne->n", basis, np.linalg.inv(basis.T @ basis), basis)
    assert regressor.noise_variance == pytest.approx(noise)
    assert regressor.predict(inputs).variance == pytest.approx(textbook, rel=1e-3)


def test_collinear_and_duplicate_rows_fit_and_the_unknown_direction_is_uncertain() -> None:
    inputs, target = samples(50)
    inputs = np.column_stack([inputs[:, 0], 2 * inputs[:, 0] + 5])
    regressor = fit_linear(np.repeat(inputs, 3, axis=0), np.repeat(target, 3))
    assert regressor.evidence["rank"] == 2
    seen = regressor.predict(inputs).variance
    apart = regressor.predict(inputs + np.array([30.0, -60.0])).variance
    assert apart.min() > 100 * seen.max()
    alone = fit_linear(inputs[:, :1], target)
    assert regressor.predict(inputs).mean == pytest.approx(alone.predict(inputs[:, :1]).mean, rel=1e-8)


def test_perfect_plane_has_no_noise() -> None:
    inputs, _ = samples()
    regressor = fit_linear(inputs, inputs @ [1.0, 2.0, 3.0])
    assert regressor.noise_variance < 1e-15
    assert regressor.predict(np.array([[1.0, 1.0, 1.0]])).mean[0] == pytest.approx(6.0)


def test_few_key_poses_are_enough_but_not_fewer() -> None:
    inputs, target = samples(5)
    fit_linear(inputs, target)
    with pytest.raises(NotTrainable, match="at least 5"):
        fit_linear(inputs[:4], target[:4])


def test_save_and_restore() -> None:
    inputs, target = samples()
    regressor = fit_linear(inputs, target)
    again = LinearRegressor.restore(regressor.arrays(), json.loads(json.dumps(regressor.settings())))
    assert np.array_equal(again.predict(inputs).mean, regressor.predict(inputs).mean)
    assert np.array_equal(again.predict(inputs).variance, regressor.predict(inputs).variance)
    assert again.settings() == regressor.settings()


@pytest.mark.parametrize("name", ["input_shift", "input_scale", "slope", "variance_root"])
def test_damaged_arrays_are_refused_by_name(name: str) -> None:
    regressor = fit_linear(*samples())
    for damage in (lambda a: a[:-1], lambda a: a * np.nan, lambda a: a.astype(np.float32)):
        arrays = regressor.arrays()
        arrays[name] = damage(arrays[name])
        with pytest.raises(DamagedArtifact):
            LinearRegressor.restore(arrays, regressor.settings())


@pytest.mark.parametrize(
    "damage", [{"method": "spgp"}, {"intercept": None}, {"noise_variance": -1}, {"evidence": 3}]
)
def test_damaged_settings_are_refused_by_name(damage: dict) -> None:
    regressor = fit_linear(*samples())
    with pytest.raises(DamagedArtifact, match=next(iter(damage))):
        LinearRegressor.restore(regressor.arrays(), regressor.settings() | damage)


def test_wrong_shape_and_cancel() -> None:
    with pytest.raises(BadInput, match="expected \\(N, 3\\)"):
        fit_linear(*samples()).predict(np.zeros((2, 2)))
    with pytest.raises(Cancelled):
        fit_linear(*samples(), cancelled=lambda: True)
