"""The likelihood of SPGP and all its derivatives (Snelson & Ghahramani 2006; Wang & Neff 2013, eq. 17).

With K = k(z, z) + jitter I = L L^T and V = L^-1 k(z, x), the target's covariance is V^T V + Lambda, where
Lambda = diag(k(x, x) - V^T V) + sigma^2 I. Everything follows from S = V Lambda^-1/2 and A = I + S S^T. One
evaluation costs seven products of size M x M x N and two passes of the covariance function, and all
derivatives, those by the pseudo-inputs included, come out of the same matrices.

Given the pseudo-inputs' values the samples are independent, so a sample that counts only w of one enters with
its Gaussian to the power w: that of variance Lambda / w, times (2 pi Lambda)^((1 - w) / 2) w^(-1/2).

With free pseudo-inputs FITC can explain scatter by its own diagonal and drive the noise to nearly zero
(Bauer, van der Wilk & Rasmussen 2016), most of all when the rotation depends on something no sensor reads.
Its objective then looks better than the exact process's best, while the exact likelihood at its
hyperparameters is far worse. So the exact likelihood of some samples has the last word (``judge``).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.covariance.base import Covariance
from glovecal_models.regression.exact import ExactLikelihood
from glovecal_models.regression.factorisation import ger, potrf, potri, syrk, trsm
from glovecal_models.regression.linear_regressor import Mean, profile_coefficients_from_products
from glovecal_models.regression.profiled_likelihood import LOG_2_PI

JITTER = 1e-6
"""Added to the diagonal of k(z, z), in units of the target's variance; it moves the likelihood, so it is
stored with the model."""


@dataclass(frozen=True)
class FitcState:
    """The matrices one evaluation leaves, valid until the next; N samples, M pseudo-inputs."""

    root: np.ndarray
    """L (M, M), lower."""
    scaled: np.ndarray
    """S (M, N)."""
    inner: np.ndarray
    """A (M, M), its lower triangle."""
    inner_root: np.ndarray
    """Lower root of A (M, M)."""
    solved: np.ndarray
    """A^-1 S (M, N)."""
    deviations: np.ndarray
    """Root of the diagonal of Lambda / w (N,)."""
    coefficients: np.ndarray
    """Of the mean (C,)."""
    projected: np.ndarray
    """b = A^-1 V (Lambda / w)^-1 (y - mean), (M,); the process's weights are L^-T b."""
    alpha: np.ndarray
    """Inverse covariance times (y - mean), (N,)."""
    value: float
    """Negative log marginal likelihood."""


class FitcLikelihood:
    """The negative log marginal likelihood over [theta, log noise variance, pseudo-inputs row by row].

    Large matrices live in buffers that every evaluation reuses: fetching fresh memory from the system
    had cost as much as the arithmetic. So one object serves one thread.
    """

    def __init__(
        self,
        x: np.ndarray,
        y: np.ndarray,
        mean: Mean,
        covariance: Covariance,
        jitter: float = JITTER,
        sample_weight: float = 1.0,
    ) -> None:
        """Samples x (N, D) and y (N,) in working units, each of which counts ``sample_weight``."""
        self.x, self.y, self.mean, self.covariance, self.jitter = x, y, mean, covariance, jitter
        self.sample_weight = sample_weight
        self._basis = mean.basis(x)
        self._buffers = np.empty((4, 0, len(x)))

    def pack(self, theta: np.ndarray, noise: float, pseudo_inputs: np.ndarray) -> np.ndarray:
        return np.concatenate([theta, [np.log(noise)], pseudo_inputs.ravel()])

    def unpack(self, parameters: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
        """Theta (P,), noise variance, pseudo-inputs (M, D)."""
        dimensions = self.x.shape[1]
        count = len(self.covariance.parameter_names(dimensions))
        pseudo_inputs = parameters[count + 1 :].reshape(-1, dimensions)
        return parameters[:count], float(np.exp(parameters[count])), pseudo_inputs

    def __call__(self, parameters: np.ndarray) -> tuple[float, np.ndarray]:
        """Value and gradient at the mean's best coefficients; raises LinAlgError where there is none."""
        theta, noise, z = self.unpack(parameters)
        cross, cross_pullback = self.covariance.with_pullback(theta, z, self.x, self._buffer(0, len(z)))
        inner, inner_pullback = self.covariance.with_pullback(theta, z, z)
        state = self._state(theta, noise, cross, inner)
        by_cross, by_inner, by_diagonal = _weights(state, self._buffer(3, len(z)), self.sample_weight)
        theta_cross, z_cross = cross_pullback(by_cross)
        theta_inner, z_inner = inner_pullback(by_inner)
        theta_diagonal, _ = self.covariance.diagonal_pullback(theta, self.x, by_diagonal)
        by_theta = theta_cross + theta_inner + theta_diagonal
        by_log_noise = noise * by_diagonal.sum()
        return state.value, np.concatenate([by_theta, [by_log_noise], (z_cross + 2 * z_inner).ravel()])

    def state(self, theta: np.ndarray, noise: float, z: np.ndarray) -> FitcState:
        """The matrices at these parameters; raises LinAlgError."""
        cross, inner = self.covariance(theta, z, self.x), self.covariance(theta, z, z)
        return self._state(theta, noise, cross, inner)

    def _buffer(self, number: int, pseudo_inputs: int) -> np.ndarray:
        if self._buffers.shape[1] != pseudo_inputs:
            self._buffers = np.empty((4, pseudo_inputs, len(self.x)))
        return self._buffers[number]

    def _state(self, theta: np.ndarray, noise: float, cross: np.ndarray, inner: np.ndarray) -> FitcState:
        root = _lower_root(inner + self.jitter * np.eye(len(inner)))
        scaled, solved = self._buffer(1, len(root)), self._buffer(2, len(root))
        np.copyto(scaled, cross)
        # A row-major (M, N) matrix is a column-major (N, M) one to BLAS, where solving from the right is
        # both in place and the faster of the two.
        trsm(1.0, root, scaled.T, side=1, lower=1, trans_a=1, overwrite_b=1)
        variances = self.covariance.diagonal(theta, self.x) - np.einsum("mn,mn->n", scaled, scaled)
        deviations = np.sqrt((np.maximum(variances, 0.0) + noise) / self.sample_weight)
        scaled *= 1.0 / deviations
        product = syrk(1.0, scaled.T, trans=1, lower=1) + np.eye(len(root))
        inner_root = _lower_root(product)
        np.copyto(solved, scaled)
        trsm(1.0, inner_root, solved.T, side=1, lower=1, trans_a=1, overwrite_b=1)
        trsm(1.0, inner_root, solved.T, side=1, lower=1, overwrite_b=1)
        coefficients, residual = self._fit_mean(scaled, solved, deviations)
        projected = solved @ residual
        alpha = (residual - projected @ scaled) / deviations
        log_determinant = 2 * float(np.log(deviations).sum() + np.log(np.diagonal(inner_root)).sum())
        value = 0.5 * (float((residual * deviations) @ alpha) + log_determinant + len(self.y) * LOG_2_PI)
        value -= self._log_normaliser(deviations)
        return FitcState(
            root, scaled, product, inner_root, solved, deviations, coefficients, projected, alpha, value
        )

    def _log_normaliser(self, deviations: np.ndarray) -> float:
        """Log of what the powers of the samples' Gaussians leave beside Gaussians; 0 for whole samples."""
        weight = self.sample_weight
        logs = LOG_2_PI + 2 * np.log(deviations) + np.log(weight)
        return float(0.5 * ((1 - weight) * logs.sum() - len(self.y) * np.log(weight)))

    def _fit_mean(
        self, scaled: np.ndarray, solved: np.ndarray, deviations: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The mean's best coefficients (C,) and (y - mean) / deviations (N,)."""
        basis = self._basis / deviations[:, None]
        target = self.y / deviations
        whitened = basis - scaled.T @ (solved @ basis)
        coefficients = profile_coefficients_from_products(whitened.T @ basis, whitened.T @ target)
        return coefficients, target - basis @ coefficients


def _weights(
    state: FitcState, spare: np.ndarray, sample_weight: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivatives of the value by k(z, x) (M, N), k(z, z) (M, M, symmetric) and Lambda's diagonal (N,).

    Consumes ``state.solved``; ``spare`` (M, N) is overwritten.
    """
    scaled, solved, alpha = state.scaled, state.solved, state.alpha
    leverage = np.einsum("mn,mn->n", scaled, solved)
    surprise = (leverage + (alpha * state.deviations) ** 2) / sample_weight
    by_diagonal = 0.5 * (1.0 - surprise) / state.deviations**2
    by_inner = _inner_weights(state, np.multiply(scaled, np.sqrt(surprise), out=spare))

    solved *= 1.0 / state.deviations
    solved -= np.multiply(scaled, (1.0 - surprise) / state.deviations, out=spare)
    ger(-1.0, alpha, state.projected, a=solved.T, overwrite_a=1)
    trsm(1.0, state.root, solved.T, side=1, lower=1, overwrite_b=1)
    return solved, by_inner, by_diagonal


def _inner_weights(state: FitcState, surprising: np.ndarray) -> np.ndarray:
    """-1/2 L^-T (2 I - A - A^-1 - b b^T + surprising surprising^T) L^-1."""
    inverse, failed = potri(state.inner_root, lower=1)
    if failed:
        raise np.linalg.LinAlgError("the sparse covariance matrix is not positive definite")
    lower = np.tril(syrk(1.0, surprising.T, trans=1, lower=1) - inverse - state.inner)
    middle = lower + np.tril(lower, -1).T + 2.0 * np.eye(len(lower))
    middle -= np.outer(state.projected, state.projected)
    middle = trsm(-0.5, state.root, np.asfortranarray(middle), side=1, lower=1, overwrite_b=1)
    return trsm(1.0, state.root, middle, side=0, lower=1, trans_a=1, overwrite_b=1)


def _lower_root(matrix: np.ndarray) -> np.ndarray:
    """Column-major lower Cholesky root from the lower triangle."""
    lower, failed = potrf(matrix, lower=1, clean=1)
    if failed:
        raise np.linalg.LinAlgError("the sparse covariance matrix is not positive definite")
    return lower


LEAST_NOISE = 0.5
"""Lower bound of the noise variance in the search, as a part of the start's. Estimates from 100 samples
scatter by 15 %, from 2000 by 3 %: half is outside either."""

TOLERATED_LOSS = 0.02
"""Nats per sample by which the exact likelihood may be worse than at the start. A noise variance 25 % too
low costs as much; sparse training of well-posed rotations costs a tenth of it."""

_MOST, _LEAST = 500, 100
"""Samples the exact likelihood is taken of: as many as they count for, within these."""


@dataclass(frozen=True)
class Verdict:
    """What the guard found."""

    accepted: bool
    loss_per_sample: float
    """Exact negative log likelihood at the trained hyperparameters less that at the start's, nats."""
    samples: int

    def sentence(self) -> str:
        if self.accepted:
            return "trained hyperparameters kept: the exact likelihood confirms them"
        return (
            f"trained hyperparameters refused: their exact likelihood is {self.loss_per_sample:.3g} nats per "
            "sample worse than the start's (noise collapse); the start's are kept. The rotation may depend "
            "on something its sensors do not read."
        )


def judge(
    likelihood: FitcLikelihood, trained: np.ndarray, start: np.ndarray, generator: np.random.Generator
) -> Verdict:
    """Compare two parameter vectors of ``likelihood`` by the exact likelihood of up to 500 samples."""
    worth = int(likelihood.sample_weight * len(likelihood.y))
    chosen = generator.permutation(len(likelihood.y))[: max(_LEAST, min(_MOST, worth))]
    x, y = likelihood.x[chosen], likelihood.y[chosen]
    exact = ExactLikelihood(x, y, likelihood.mean, likelihood.covariance)
    values = []
    for parameters in (trained, start):
        theta, noise, _ = likelihood.unpack(parameters)
        values.append(exact.value(np.concatenate([theta, [np.log(noise)]])))
    loss = (values[0] - values[1]) / len(chosen)
    return Verdict(loss <= TOLERATED_LOSS, loss, len(chosen))
