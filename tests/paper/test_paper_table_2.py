"""Table 2 of the paper on few tuples: its order of models, and NLML as GPy and scikit-learn compute it."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
from table_2 import MODELS, PAPER, Table2Row, Tuples, nlml_deg, table_2, tuples

EVERY, SEED = 7, 1


@pytest.fixture(scope="module")
def data() -> Tuples:
    return tuples(SEED, EVERY)


@pytest.fixture(scope="module")
def rows() -> dict[tuple[str, str], Table2Row]:
    return {(row.mean, row.covariance): row for row in table_2(SEED, EVERY)}


def test_tuples_are_widgets_and_touches(data) -> None:
    assert data.inputs.shape == (len(data.target), 3)
    assert data.clip.shape == (267, 3)
    widgets = np.isin(data.target, (0.0, 10.0, 20.0, 30.0))
    assert 0.7 < widgets.mean() < 0.8
    assert len(np.unique(data.target[widgets])) == 4


def test_the_papers_order(rows) -> None:
    assert list(rows) == list(MODELS)
    assert set(rows) - set(PAPER) == {("m_l", "k_seARD, fast trainer")}
    linear = [row for row in rows.values() if row.covariance == "k_LARD"]
    others = [row for row in rows.values() if row.covariance != "k_LARD"]
    assert min(row.nlml for row in linear) > max(row.nlml for row in others) + 40
    assert min(row.log_sigma for row in linear) > max(row.log_sigma for row in others) + 0.2
    assert min(row.clip_rmse_deg for row in linear) > 1.4 * max(row.clip_rmse_deg for row in others)
    chosen, fast = rows["m_l", "k_LARD + k_seARD"], rows["m_l", "k_seARD, fast trainer"]
    assert chosen.nlml < min(row.nlml for row in others) + 8
    assert fast.nlml < chosen.nlml + 0.1


def test_nested_models_fit_no_worse(rows) -> None:
    """Each covariance holds the one before it as a special case."""
    for mean in ("m_0", "m_l"):
        both = rows[mean, "k_seARD + k_seARD"].nlml
        assert both < rows[mean, "k_RBF"].nlml + 0.1
        assert rows[mean, "k_LARD + k_seARD"].nlml < rows[mean, "k_LARD"].nlml + 0.1


def test_nlml_is_scikit_learns(data) -> None:
    """(m_0, k_RBF), in degrees: the target centred by both, hyperparameters given."""
    regressor = MODELS["m_0", "k_RBF"](data.inputs, data.target)
    x = (data.inputs - regressor.input_shift) / regressor.input_scale
    eta, gamma = np.exp(regressor.theta)
    no_search: Any = None
    kernel = ConstantKernel(eta) * RBF(gamma**-0.5) + WhiteKernel(regressor.noise_variance)
    theirs = GaussianProcessRegressor(kernel, alpha=regressor.jitter, optimizer=no_search)
    theirs.fit(x, data.target - data.target.mean())
    value = -float(np.asarray(theirs.log_marginal_likelihood_value_))
    assert nlml_deg(regressor, len(x)) == pytest.approx(value, rel=1e-8)


def test_nlml_is_gpys(data) -> None:
    """(m_l, k_LARD + k_seARD), in degrees: the mean given as a fixed mapping."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import GPy
    regressor = MODELS["m_l", "k_LARD + k_seARD"](data.inputs, data.target)
    x = (data.inputs - regressor.input_shift) / regressor.input_scale
    beta, eta, gamma = np.split(np.exp(regressor.theta), [3, 4])
    kernel = GPy.kern.Linear(3, variances=beta, ARD=True)
    kernel = kernel + GPy.kern.RBF(3, variance=float(eta[0]), lengthscale=gamma**-0.5, ARD=True)
    left = data.target - x @ regressor.slope - regressor.intercept
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        noise = regressor.noise_variance + regressor.jitter
        theirs = GPy.models.GPRegression(x, left[:, None], kernel, noise_var=noise)
    assert nlml_deg(regressor, len(x)) == pytest.approx(-float(np.squeeze(theirs.log_likelihood())), rel=1e-7)
