"""scikit-learn: exact process; its linear part can only be a covariance."""

# pyright: reportMissingImports=false, reportAttributeAccessIssue=false, reportArgumentType=false

from __future__ import annotations

import time
import warnings
from collections.abc import Callable

import numpy as np
import sklearn
from gaussian_process_reference import Hyperparameters, Trained
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, DotProduct, WhiteKernel

VERSION = sklearn.__version__


def train(x: np.ndarray, y: np.ndarray) -> tuple[Trained, GaussianProcessRegressor]:
    squared_exponential = ConstantKernel(1.0) * RBF(np.ones(x.shape[1]))
    linear = ConstantKernel(1.0) * DotProduct(1.0)
    model = GaussianProcessRegressor(squared_exponential + linear + WhiteKernel(0.1), alpha=0.0)
    start = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit(x, y)
    seconds = time.process_time() - start
    found = model.kernel_.get_params()
    slope = found["k1__k2__k1__constant_value"]
    offset = slope * found["k1__k2__k2__sigma_0"] ** 2
    given = Hyperparameters(
        np.atleast_1d(found["k1__k1__k2__length_scale"]),
        found["k1__k1__k1__constant_value"],
        found["k2__noise_level"],
        np.append(np.full(x.shape[1], slope), offset),
    )
    note = "linear part as a covariance"
    own = -float(model.log_marginal_likelihood_value_)
    return Trained("scikit-learn exact", seconds, given, note, own), model


def glove_frame_predictor(
    model: GaussianProcessRegressor, x: np.ndarray, rotations: int
) -> Callable[[], object]:
    """One frame through ``rotations`` exact models (it has no sparse one), mean and deviation."""
    frame = x[:1].copy()
    return lambda: [model.predict(frame, return_std=True) for _ in range(rotations)]
