"""The stored form of a trained process: prediction, save and restore, refusals."""

import json

import numpy as np
import pytest
from scipy.linalg import cholesky, solve_triangular

from glovecal_models.covariance.functions import SquaredExponentialArd
from glovecal_models.errors import BadInput, DamagedArtifact
from glovecal_models.regression.regressor import ProcessRegressor


def exact_process(samples: int = 30, dimensions: int = 2) -> tuple[ProcessRegressor, np.ndarray, np.ndarray]:
    """An exact process by textbook formulas, with inputs in counts; returns also x and y."""
    generator = np.random.default_rng(1)
    x = generator.normal(size=(samples, dimensions))
    y = np.sin(x[:, 0]) + 2 * x[:, -1]
    covariance, theta = SquaredExponentialArd(), np.log([4.0, *[0.7] * dimensions])
    slope, noise = np.full(dimensions, 1.5), 0.01
    lower = cholesky(covariance(theta, x, x) + noise * np.eye(samples), lower=True)
    root = solve_triangular(lower, np.eye(samples), lower=True).T
    regressor = ProcessRegressor(
        method="gpr",
        input_shift=np.full(dimensions, 100.0),
        input_scale=np.full(dimensions, 20.0),
        slope=slope,
        intercept=3.0,
        covariance=covariance,
        theta=theta,
        nodes=x,
        weights=root @ root.T @ (y - x @ slope - 3.0),
        variance_root=root,
        noise_variance=noise,
        jitter=0.0,
        evidence={"nlml": 1.5},
    )
    return regressor, x, y


def test_prediction_is_the_textbook_formula_with_the_mean() -> None:
    regressor, x, y = exact_process()
    new = np.random.default_rng(2).normal(size=(5000, 2))
    prediction = regressor.predict(100.0 + 20.0 * new)
    k = regressor.covariance(regressor.theta, new, x)
    gram = regressor.covariance(regressor.theta, x, x) + 0.01 * np.eye(len(x))
    mean = new @ regressor.slope + 3.0
    assert prediction.mean == pytest.approx(
        mean + k @ np.linalg.solve(gram, y - x @ regressor.slope - 3.0), abs=1e-9
    )
    assert prediction.variance == pytest.approx(
        4.0 - np.sum(k * np.linalg.solve(gram, k.T).T, axis=1), abs=1e-9
    )


def test_prediction_far_from_the_samples_is_the_mean_and_the_prior_variance() -> None:
    regressor, _, _ = exact_process()
    prediction = regressor.predict(np.full((1, 2), 100.0 + 20.0 * 50.0))
    assert prediction.mean[0] == pytest.approx(3.0 + 2 * 1.5 * 50.0)
    assert prediction.variance[0] == pytest.approx(4.0)


def test_restored_regressor_predicts_bit_for_bit_the_same() -> None:
    regressor, x, _ = exact_process()
    settings = json.loads(json.dumps(regressor.settings(), allow_nan=False))
    again = ProcessRegressor.restore(regressor.arrays(), settings)
    inputs = 100.0 + 20.0 * x
    assert np.array_equal(again.predict(inputs).mean, regressor.predict(inputs).mean)
    assert np.array_equal(again.predict(inputs).variance, regressor.predict(inputs).variance)
    assert again.settings() == regressor.settings()
    assert again.hyperparameters["log_signal_variance"] == np.log(4.0)


@pytest.mark.parametrize("inputs", [np.zeros(2), np.zeros((3, 1)), np.zeros((3, 3))])
def test_prediction_refuses_another_number_of_sensors(inputs: np.ndarray) -> None:
    with pytest.raises(BadInput, match="expected \\(N, 2\\)"):
        exact_process()[0].predict(inputs)


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("theta", lambda a: a[:-1]),
        ("weights", lambda a: a[:-1]),
        ("weights", lambda a: a[:, None]),
        ("nodes", lambda a: a[:, :1]),
        ("slope", lambda a: a * np.nan),
        ("slope", lambda a: a.astype(np.float32)),
        ("input_scale", lambda a: a * 0),
        ("variance_root", lambda a: a[:5]),
    ],
)
def test_restore_refuses_damaged_arrays_by_name(name: str, damage) -> None:
    regressor, _, _ = exact_process()
    arrays = regressor.arrays()
    arrays[name] = damage(arrays[name])
    with pytest.raises(DamagedArtifact, match=name):
        ProcessRegressor.restore(arrays, regressor.settings())


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("noise_variance", -1.0),
        ("noise_variance", None),
        ("intercept", float("nan")),
        ("jitter", "0"),
        ("jitter", True),
        ("method", "linear"),
        ("covariance", {"kind": "os.system"}),
        ("covariance", None),
        ("covariance", {"kind": "sum", "terms": []}),
        ("covariance", {"kind": "sum", "terms": [{"kind": "sum", "terms": []}]}),
        ("evidence", []),
    ],
)
def test_restore_refuses_damaged_settings_by_name(name: str, value: object) -> None:
    regressor, _, _ = exact_process()
    with pytest.raises(DamagedArtifact, match=name):
        ProcessRegressor.restore(regressor.arrays(), regressor.settings() | {name: value})


def test_restore_refuses_missing_and_unknown_arrays() -> None:
    regressor, _, _ = exact_process()
    arrays = regressor.arrays()
    with pytest.raises(DamagedArtifact, match="extra"):
        ProcessRegressor.restore(arrays | {"extra": np.zeros(1)}, regressor.settings())
    del arrays["nodes"]
    with pytest.raises(DamagedArtifact, match="nodes"):
        ProcessRegressor.restore(arrays, regressor.settings())
