"""GPy: exact process with a linear mean, and FITC with moving pseudo-inputs (which allows no mean)."""

# pyright: reportMissingImports=false, reportAttributeAccessIssue=false, reportArgumentType=false

from __future__ import annotations

import time
import warnings
from collections.abc import Callable

import numpy as np
from gaussian_process_reference import Hyperparameters, Trained

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import GPy

VERSION = GPy.__version__


def train_exact(x: np.ndarray, y: np.ndarray, most_iterations: int = 1000) -> Trained:
    dimensions = x.shape[1]
    mean = GPy.mappings.Additive(GPy.mappings.Linear(dimensions, 1), GPy.mappings.Constant(dimensions, 1))
    start = time.process_time()
    kernel = GPy.kern.RBF(dimensions, ARD=True)
    model = GPy.models.GPRegression(x, y[:, None], kernel, mean_function=mean)
    model.optimize(max_iters=most_iterations)
    seconds = time.process_time() - start
    given = Hyperparameters(
        np.array(kernel.lengthscale), float(kernel.variance[0]), float(model.likelihood.variance[0])
    )
    evaluations = model.optimization_runs[-1].funct_eval
    return Trained("GPy exact", seconds, given, "", float(model.objective_function()), evaluations)


def train_fitc(x: np.ndarray, y: np.ndarray, iterations: int) -> Trained:
    """M = 100, pseudo-inputs optimised jointly; the linear part is a covariance."""
    generator = np.random.default_rng(0)
    pseudo = x[generator.choice(len(x), 100, replace=False)]
    start = time.process_time()
    model = _sparse(x, y, pseudo, GPy.kern.RBF(x.shape[1], ARD=True))
    model.optimize(max_iters=iterations)
    seconds = time.process_time() - start
    kernel = model.kern
    linear = np.append(np.array(kernel.linear.variances), float(kernel.bias.variance[0]))
    given = Hyperparameters(
        np.array(kernel.rbf.lengthscale),
        float(kernel.rbf.variance[0]),
        float(model.likelihood.variance[0]),
        linear,
    )
    evaluations = model.optimization_runs[-1].funct_eval
    objective = float(model.objective_function())
    return Trained("GPy FITC", seconds, given, f"{iterations} iterations", objective, evaluations)


def glove_frame_predictor(
    x: np.ndarray, y: np.ndarray, pseudo: np.ndarray, given: Hyperparameters, rotations: int
) -> Callable[[], object]:
    """One frame through ``rotations`` sparse models of 100 pseudo-inputs, mean and variance."""
    models = []
    for _ in range(rotations):
        kernel = GPy.kern.RBF(x.shape[1], variance=given.signal, lengthscale=given.lengthscales, ARD=True)
        model = _sparse(x, y, pseudo, kernel)
        model.likelihood.variance = given.noise
        models.append(model)
    frame = x[:1].copy()
    return lambda: [model.predict_noiseless(frame) for model in models]


def _sparse(x: np.ndarray, y: np.ndarray, pseudo: np.ndarray, rbf: object):
    dimensions = x.shape[1]
    kernel = rbf + GPy.kern.Linear(dimensions, ARD=True) + GPy.kern.Bias(dimensions)  # type: ignore[operator]
    return GPy.core.SparseGP(
        x,
        y[:, None],
        pseudo.copy(),
        kernel,
        GPy.likelihoods.Gaussian(),
        inference_method=GPy.inference.latent_function_inference.FITC(),
    )
