"""GPBoost: the fastest training peer (FITC on k-means points that do not move), and its exact process."""

# pyright: reportMissingImports=false, reportAttributeAccessIssue=false, reportArgumentType=false

from __future__ import annotations

import contextlib
import os
import time
import warnings
from collections.abc import Iterator

import gpboost
import numpy as np
from gaussian_process_reference import Hyperparameters, Trained

VERSION = gpboost.__version__


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """GPBoost's warnings (duplicate inputs) come from C, on standard output."""
    kept = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def train(x: np.ndarray, y: np.ndarray, *, approximation: str) -> tuple[Trained, gpboost.GPModel]:
    """``approximation``: ``fitc`` (100 points) or ``none`` (exact). The mean is linear."""
    design = np.column_stack([np.ones(len(x)), x])
    start = time.process_time()
    with _quiet(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = gpboost.GPModel(
            gp_coords=x,
            cov_function="gaussian_ard" if x.shape[1] > 1 else "gaussian",
            likelihood="gaussian",
            gp_approx=approximation,
            num_ind_points=100,
            seed=1,
            num_parallel_threads=1,
        )
        model.fit(y=y, X=design, params={"trace": False})
    seconds = time.process_time() - start
    noise, signal, *ranges = np.asarray(model.get_cov_pars(), dtype=float).ravel()[: 2 + x.shape[1]]
    lengthscales = np.array(ranges) / np.sqrt(2.0)
    given = Hyperparameters(lengthscales, float(signal), float(noise))
    label = "GPBoost FITC" if approximation == "fitc" else "GPBoost exact"
    return Trained(label, seconds, given, "", float(model.get_current_neg_log_likelihood())), model


def frame_predictor(model: gpboost.GPModel, x: np.ndarray):
    """Mean and variance of one frame (1, D)."""
    design = np.column_stack([np.ones(1), x[:1]])

    def predict() -> object:
        with _quiet():
            return model.predict(gp_coords_pred=x[:1], X_pred=design, predict_var=True)

    return predict
