"""GPyTorch: exact process by L-BFGS, and sparse (SGPR) models for the frame rate."""

# pyright: reportMissingImports=false, reportAttributeAccessIssue=false, reportArgumentType=false

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import Any

import gpytorch
import numpy as np
import torch
from gaussian_process_reference import Hyperparameters, Trained

VERSION = gpytorch.__version__


class _Process(gpytorch.models.ExactGP):
    def __init__(
        self, x: torch.Tensor, y: torch.Tensor, likelihood: Any, pseudo: torch.Tensor | None = None
    ) -> None:
        super().__init__(x, y, likelihood)
        self.mean_module = gpytorch.means.LinearMean(x.shape[1])
        smooth = gpytorch.kernels.ScaleKernel(gpytorch.kernels.RBFKernel(ard_num_dims=x.shape[1]))
        self.smooth = smooth
        self.covar_module = smooth
        if pseudo is not None:
            self.covar_module = gpytorch.kernels.InducingPointKernel(
                smooth, inducing_points=pseudo, likelihood=likelihood
            )

    def forward(self, x: torch.Tensor) -> Any:
        return gpytorch.distributions.MultivariateNormal(self.mean_module(x), self.covar_module(x))


def train_exact(x: np.ndarray, y: np.ndarray, most_evaluations: int) -> Trained:
    """L-BFGS with strong Wolfe search, Cholesky, stopped after ``most_evaluations``."""
    torch.set_num_threads(1)
    inputs, target = torch.as_tensor(x), torch.as_tensor(y)
    likelihood = gpytorch.likelihoods.GaussianLikelihood().double()
    model = _Process(inputs, target, likelihood).double()
    model.train()
    objective = gpytorch.mlls.ExactMarginalLogLikelihood(likelihood, model)
    search = torch.optim.LBFGS(
        model.parameters(),
        max_iter=most_evaluations,
        max_eval=most_evaluations,
        line_search_fn="strong_wolfe",
    )
    counted = [0]

    def closure() -> torch.Tensor:
        search.zero_grad()
        loss = -objective(model(inputs), target)
        loss.backward()
        counted[0] += 1
        return loss

    start = time.process_time()
    with (
        gpytorch.settings.max_cholesky_size(10_000),
        gpytorch.settings.fast_computations(False, False, False),
    ):
        search.step(closure)
    seconds = time.process_time() - start
    given = Hyperparameters(
        model.smooth.base_kernel.lengthscale.detach().numpy().ravel(),
        float(model.smooth.outputscale.detach()),
        float(likelihood.noise.detach()),
    )
    note = f"stopped after {counted[0]} evaluations" if counted[0] >= most_evaluations else ""
    return Trained("GPyTorch exact", seconds, given, note, None, counted[0])


def glove_frame_predictor(
    x: np.ndarray, y: np.ndarray, pseudo: np.ndarray, given: Hyperparameters, rotations: int
) -> Callable[[], object]:
    """One frame through ``rotations`` SGPR models of 100 inducing points, mean and variance, caches warm."""
    torch.set_num_threads(1)
    warnings.filterwarnings("ignore", module="gpytorch|linear_operator")
    models = []
    for _ in range(rotations):
        likelihood = gpytorch.likelihoods.GaussianLikelihood().double()
        model = _Process(torch.as_tensor(x), torch.as_tensor(y), likelihood, torch.as_tensor(pseudo.copy()))
        model = model.double()
        likelihood.noise = given.noise
        model.smooth.outputscale = given.signal
        model.smooth.base_kernel.lengthscale = torch.as_tensor(given.lengthscales)
        model.eval()
        models.append(model)
    frame = torch.as_tensor(x[:1].copy())

    def predict() -> object:
        with torch.no_grad(), gpytorch.settings.fast_pred_var():
            answers = [model(frame) for model in models]
            return [(answer.mean, answer.variance) for answer in answers]

    return predict
