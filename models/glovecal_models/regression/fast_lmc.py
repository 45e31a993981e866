"""LMC-GPR of Wang & Neff (2013), section 6.1, at its maximum-likelihood optimum in well under a second.

The paper's covariance is k_LARD + k_seARD with a linear mean. When the mean's coefficients maximise the
likelihood, so do beta_d = 0: the generalised least-squares residual does not change when X B X' (B the
diagonal of beta, not negative) is added to K, because that residual is orthogonal to X in the metric of
K^-1 already, while log|K + X B X'| can only grow. So the trained model is a plane plus k_seARD, which is
what ``fit_lmc_gpr`` searches, with plane and scale in closed form, and D + 1 parameters left.

Steps: merge equal inputs; several starts on few nodes (``multi_start``); refine the best to 1e-4 nats, by
exact evaluations where nodes do not suffice (``lmc_search``); bracket the exact NLML (``certify``); keep
as many nodes as the served mean and standard deviation need (``served_nodes``).

The search for LMC-GPR's maximum-likelihood optimum, up to where it becomes expensive and from there on.

Nodes make a search's cost independent of N. Where short lengthscales need too many of them, exact evaluations
with all samples follow, a quarter of a second each for 2000: whoever may not need them can stop before.

A rough process is good enough to compare settings by its errors: lengthscales and noise come from 800 samples
at most, where an exact evaluation costs a tenth of one with 2000; plane, scale and mean are those of all
samples. No nodes are chosen and nothing is certified: it is never served.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from glovecal_models.covariance.functions import SquaredExponentialArd
from glovecal_models.errors import NotTrainable
from glovecal_models.progress import Cancel, Report, stop_if
from glovecal_models.regression.factorisation import PivotedCholesky, pivoted_cholesky
from glovecal_models.regression.multi_start import (
    FEW,
    MOST_NODES,
    SAME_OPTIMUM,
    SCREENED,
    Candidate,
    descend,
    screen,
    screen_one,
    search_exactly,
    some_samples,
)
from glovecal_models.regression.profiled_likelihood import (
    Certificate,
    ExactProfiledLikelihood,
    NystromFit,
    Profile,
    TrainingProcess,
    certify,
    profile,
)
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_models.regression.served_nodes import NodeChooser, Reference, ServedNodes
from glovecal_models.regression.training_samples import (
    MergedSamples,
    Standardised,
    check_samples,
    standardise,
)

MOST_EXACT = 4000
"""Distinct inputs up to which an N x N matrix is formed; 128 MB each at this size."""
LARGEST_FACTOR = 8e6
"""Entries of a low-rank factor: 64 MB."""
TIGHT = 0.05
"""Nats: a factorisation that brackets the likelihood so closely stands for the exact process."""
MEAN_ERROR_DEG, SD_ERROR_DEG = 5e-4, 1e-3
"""How closely served nodes follow the exact process at training inputs."""
SHORT_LENGTHSCALE = 0.5
"""Standard deviations of an input. Shorter ones that also need many nodes hint at a missing input."""
CLEAR_GAIN = 20.0
"""Nats over the plane below which a process's shape tells nothing."""


class LmcOptimum(NamedTuple):
    """What a training has found; one of nearly the same samples begins there, from no other start."""

    sample_weight: float
    parameters: tuple[float, ...] = ()
    """Log lengthscales and log noise-to-signal ratio (D + 1,), standardised units; empty: not known."""

    @classmethod
    def of(cls, evidence: Mapping[str, Any]) -> LmcOptimum | None:
        """From what a regressor tells of its training; None where it is no LMC-GPR."""
        weight = evidence.get("sample_weight")
        return None if weight is None else cls(float(weight), tuple(map(float, evidence.get("optimum", ()))))


@dataclass(frozen=True)
class LmcSearch:
    """Starts compared and, where nodes suffice, the best refined."""

    standard: Standardised
    samples: MergedSamples
    sample_weight: float
    precision: np.ndarray | None
    """(N,) of each sample's noise, relative; None: all alike."""
    found: tuple[Candidate, ...]
    """Distinct optima, best first, roughly located."""
    account: list[dict[str, Any]]
    """What became of every start, JSON-able."""
    on_nodes: Candidate | None
    """The best of ``found`` refined on nodes; None where there are too few samples for that, or nodes."""
    generator: np.random.Generator

    @classmethod
    def begin(
        cls,
        inputs: np.ndarray,
        target: np.ndarray,
        *,
        sample_weight: float = 1.0,
        precision: np.ndarray | None = None,
        start: Sequence[float] = (),
        seed: int = 0,
        cancelled: Cancel | None = None,
    ) -> LmcSearch:
        """From ``inputs`` (N, D), counts, and ``target`` (N,), degrees. ``start``: ``LmcOptimum.parameters``,
        where it is known; else several are tried. ``precision`` (N,): as ``MergedSamples.of`` takes it.
        Raises NotTrainable, Cancelled."""
        standard = standardise(*check_samples(inputs, target))
        samples = MergedSamples.of(standard.x, standard.y, sample_weight, precision)
        generator = np.random.default_rng(seed)
        distinct, on_nodes = len(samples.inputs), None
        if len(start) == standard.x.shape[1] + 1:
            found, account = screen_one(samples, np.array(start), cancelled)
        else:
            found, account = screen(
                samples, standard.x, standard.y, generator, cancelled, sample_weight, precision
            )
        if distinct > FEW:
            nodes = min(MOST_NODES, distinct // 2)
            on_nodes = descend(samples, found[0].parameters, fine=True, most_nodes=nodes, cancelled=cancelled)
        return cls(standard, samples, sample_weight, precision, tuple(found), account, on_nodes, generator)

    @property
    def is_expensive(self) -> bool:
        """Whether what is left takes exact evaluations with many samples."""
        return self.on_nodes is None and len(self.samples.inputs) > 2 * SCREENED

    def optimum(self, cancelled: Cancel | None = None) -> Candidate:
        """Refine the most promising optimum; others too while that is cheap, which exact searches are not."""
        best = self.on_nodes or self._refined_exactly(cancelled)
        for candidate in self.found[1:3] if len(self.samples.inputs) <= MOST_EXACT or best.low_rank else ():
            stop_if(cancelled, "training")
            if np.abs(candidate.parameters - best.parameters).max() < SAME_OPTIMUM:
                continue
            nodes = min(MOST_NODES, len(self.samples.inputs))
            rival = descend(
                self.samples, candidate.parameters, fine=True, most_nodes=nodes, cancelled=cancelled
            )
            if rival is not None and rival.nlml < best.nlml - 1e-3:
                best = rival
        return best

    def _refined_exactly(self, cancelled: Cancel | None) -> Candidate:
        """By exact evaluations, to 1e-6 nats of few samples and 1e-3 of many; from some of very many.

        They start from the optimum of a subset, where an evaluation costs a fifteenth.
        """
        samples, rough, standard = self.samples, self.found[0], self.standard
        distinct, weight, precision = len(samples.inputs), self.sample_weight, self.precision
        if distinct <= FEW:
            return search_exactly(samples, rough.parameters, tolerance=1e-6, cancelled=cancelled) or rough
        if distinct > MOST_EXACT:
            samples = some_samples(standard.x, standard.y, 2000, self.generator, weight, precision)
        if len(samples.inputs) > 2 * SCREENED:
            subset = some_samples(standard.x, standard.y, SCREENED, self.generator, weight, precision)
            rough = search_exactly(subset, rough.parameters, tolerance=0.05, cancelled=cancelled) or rough
        return search_exactly(samples, rough.parameters, tolerance=1e-3, cancelled=cancelled) or rough


LEAST_SEARCHED = 500
TOLERANCE = 0.05
"""Nats that one more step of the search may still promise."""


@dataclass(frozen=True)
class RoughProcess:
    """A process that predicts a mean, and tells how flexible it is."""

    parameters: np.ndarray
    """Log lengthscales and log noise-to-signal ratio (D + 1,), standardised units."""
    _standard: Standardised
    _samples: MergedSamples
    _process: TrainingProcess

    def mean(self, inputs: np.ndarray) -> np.ndarray:
        """Degrees (N,), at raw inputs (N, D)."""
        x = (inputs - self._standard.input_shift) / self._standard.input_scale
        plane = self._samples.to_plane @ self._process.profile.plane
        theta = np.append(0.0, -2.0 * self.parameters[:-1])
        smooth = SquaredExponentialArd()(theta, x, self._samples.inputs) @ self._process.weights
        return self._standard.target_shift + self._standard.target_scale * (
            x @ plane[:-1] + plane[-1] + smooth
        )

    def degrees_of_freedom(self) -> float:
        """Sum over its samples, as they count, of variance over noise variance, 1 at most. Ask once."""
        noise = float(np.exp(self.parameters[-1])) * self._process.profile.scale
        share = np.minimum(self._process.variance() / max(noise, 1e-300), 1.0)
        return float(share @ self._samples.root_count**2)


def fit_roughly(
    inputs: np.ndarray,
    target: np.ndarray,
    *,
    start: np.ndarray,
    sample_weight: float = 1.0,
    seed: int = 0,
    cancelled: Cancel | None = None,
) -> RoughProcess:
    """Of ``inputs`` (N, D), raw counts, and ``target`` (N,), degrees, each sample counting ``sample_weight``.

    ``start``: parameters near the optimum, as ``LmcSearch.found`` has them for more samples of the same
    weight. Raises NotTrainable, Cancelled.
    """
    standard = standardise(*check_samples(inputs, target))
    samples = MergedSamples.of(standard.x, standard.y, sample_weight)
    generator = np.random.default_rng(seed)
    if len(samples.inputs) > MOST_EXACT:
        samples = some_samples(standard.x, standard.y, MOST_EXACT // 2, generator, sample_weight)
    # as few as count whole ones together: fewer would have to count for more than one each
    searched = int(np.clip(np.ceil(sample_weight * len(target)), LEAST_SEARCHED, SCREENED))
    subset = some_samples(standard.x, standard.y, searched, generator, sample_weight)
    optimum = search_exactly(subset, start, tolerance=TOLERANCE, cancelled=cancelled)
    parameters = start if optimum is None else optimum.parameters
    process = ExactProfiledLikelihood(samples).training_process(parameters)
    if process is None:
        raise NotTrainable(f"no process of these {len(target)} samples can be computed at {parameters}")
    return RoughProcess(parameters, standard, samples, process)


@dataclass(frozen=True)
class _Trained:
    """Hyperparameters at the optimum and what is known of their likelihood."""

    parameters: np.ndarray
    profile: Profile
    certificate: Certificate
    factor: PivotedCholesky
    reference: Reference | None
    """The exact process at the training inputs, where it was evaluated."""


def fit_lmc_gpr(
    inputs: np.ndarray,
    target: np.ndarray,
    *,
    sample_weight: float = 1.0,
    seed: int = 0,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> ProcessRegressor:
    """Train on ``inputs`` (N, D), raw counts, and ``target`` (N,), degrees; same seed, same result.

    Each sample counts ``sample_weight``, at most 1: less where neighbours repeat each other's errors.

    ``evidence`` tells: ``nlml`` (standardised units; + N log target_scale_deg in degrees) and the bracket
    ``nlml_lower``..``nlml_upper`` of the exact value, ``starts``, ``evaluations``, ``exact_evaluation``,
    ``served_mean_error_deg`` and ``served_sd_error_deg`` (None where the exact process is out of reach:
    very many samples and short lengthscales), ``missing_input_suspected``.
    Raises NotTrainable on unusable samples, Cancelled when ``cancelled`` answers True.
    """
    say = report or (lambda sentence, fraction: None)
    say("searching from several starts", 0.0)
    search = LmcSearch.begin(inputs, target, sample_weight=sample_weight, seed=seed, cancelled=cancelled)
    return finish_search(search, cancelled=cancelled, report=report)


def finish_search(
    search: LmcSearch,
    *,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> ProcessRegressor:
    """What ``fit_lmc_gpr`` returns, from a search that has begun. Raises Cancelled."""
    say = report or (lambda sentence, fraction: None)
    samples, standard = search.samples, search.standard
    stop_if(cancelled, "training")
    say("refining the best optimum", 0.4)
    refined = search.optimum(cancelled)
    stop_if(cancelled, "training")
    say("bounding the likelihood and choosing nodes", 0.8)
    trained = _examine(samples, refined)
    scale_deg = standard.target_scale
    served = _served(samples, trained, scale_deg)
    evidence = _evidence(samples, trained, refined, served, scale_deg)
    evidence |= {"samples": len(standard.y), "sample_weight": search.sample_weight, "starts": search.account}
    say("trained", 1.0)
    return _regressor(samples, standard, trained, served, evidence)


def _examine(samples: MergedSamples, refined: Candidate) -> _Trained:
    """Profile, certificate and nodes at the optimum; exactly where that is affordable or needed."""
    parameters, distinct = refined.parameters, len(samples.inputs)
    rho = float(np.exp(parameters[-1]))
    points = samples.inputs * np.exp(-parameters[:-1])
    exact = distinct <= FEW or (not refined.low_rank and distinct <= MOST_EXACT)
    tolerance = 1e-12 if exact else float(np.clip(0.05 * rho / samples.total**2, 1e-13, 1e-8))
    most = int(min(800 if refined.low_rank else 600, distinct, LARGEST_FACTOR / distinct))
    factor = pivoted_cholesky(points, tolerance, most)
    if not exact:
        fit = NystromFit(samples, factor.rows, rho)
        best = fit.profile()
        trace = float(samples.root_count**2 @ factor.residual)
        certificate = certify(fit, trace, best.plane, best.scale)
        if certificate.width <= TIGHT or distinct > MOST_EXACT:
            return _Trained(parameters, best, certificate, factor, None)
    process = ExactProfiledLikelihood(samples).training_process(parameters)
    if process is None:
        raise ArithmeticError(f"covariance is not positive definite at {parameters.tolist()}")
    reference = Reference(process.mean, process.variance(), process.weights)
    nlml = process.profile.nlml
    known = Certificate(nlml, nlml, "exact evaluation")
    return _Trained(parameters, process.profile, known, factor, reference)


def _served(samples: MergedSamples, trained: _Trained, scale_deg: float) -> ServedNodes:
    """Nodes within ``MEAN_ERROR_DEG`` of the exact process, or all that were offered."""
    rho = float(np.exp(trained.parameters[-1]))
    best, factor = trained.profile, trained.factor
    fit = NystromFit(samples, factor.rows, rho)
    chooser = NodeChooser(fit, factor.rows, factor.pivots, best.residual, best.scale)
    reference = trained.reference or chooser.reference()
    acceptable = MEAN_ERROR_DEG / scale_deg
    size = chooser.choose(reference, acceptable, SD_ERROR_DEG / scale_deg, len(factor.pivots))
    return chooser.serve(size, reference, acceptable)


def _regressor(
    samples: MergedSamples,
    standard: Standardised,
    trained: _Trained,
    served: ServedNodes,
    evidence: dict[str, Any],
) -> ProcessRegressor:
    """Everything in degrees."""
    scale_deg, best = standard.target_scale, trained.profile
    plane = samples.to_plane @ best.plane * scale_deg
    signal = best.scale * scale_deg**2
    return ProcessRegressor(
        method="lmc_gpr",
        input_shift=standard.input_shift,
        input_scale=standard.input_scale,
        slope=plane[:-1],
        intercept=float(plane[-1] + standard.target_shift),
        covariance=SquaredExponentialArd(),
        theta=np.append(np.log(signal), -2.0 * trained.parameters[:-1]),
        nodes=samples.inputs[served.pivots],
        weights=served.weights * (scale_deg / signal),
        variance_root=served.variance_root / np.sqrt(signal),
        noise_variance=float(np.exp(trained.parameters[-1])) * signal,
        jitter=0.0,
        evidence=evidence,
    )


def _evidence(
    samples: MergedSamples, trained: _Trained, refined: Candidate, served: ServedNodes, scale_deg: float
) -> dict[str, Any]:
    lengthscales = np.exp(trained.parameters[:-1])
    certificate = trained.certificate
    known = trained.reference is not None or certificate.width <= TIGHT
    by_plane = _nlml_of_plane(samples)
    many = not refined.low_rank and len(samples.inputs) > FEW
    collapsed = float(lengthscales.min()) < (SHORT_LENGTHSCALE if many else 0.2 * SHORT_LENGTHSCALE)
    return {
        "distinct_inputs": len(samples.inputs),
        "nlml": trained.profile.nlml,
        "nlml_lower": float(certificate.lower),
        "nlml_upper": float(certificate.upper),
        "certificate": certificate.how,
        "target_scale_deg": scale_deg,
        "lengthscales": lengthscales.tolist(),
        "optimum": trained.parameters.tolist(),
        "evaluations": refined.evaluations,
        "exact_evaluation": trained.reference is not None,
        "served_nodes": len(served.pivots),
        "variance_nodes": int(np.count_nonzero(served.variance_root.any(axis=1))),
        "served_mean_error_deg": served.mean_error * scale_deg if known else None,
        "served_sd_error_deg": served.sd_error * scale_deg if known else None,
        "nlml_of_plane": by_plane,
        "missing_input_suspected": collapsed and trained.profile.nlml < by_plane - CLEAR_GAIN,
    }


def _nlml_of_plane(samples: MergedSamples) -> float:
    """Of the linear model alone, standardised units: the limit of all noise and no signal."""
    basis, target = samples.columns[:, :-1], samples.columns[:, -1]
    left = float(target @ target) - float(np.sum((basis.T @ target) ** 2)) + samples.scatter
    return profile(np.array([[1.0, 0.0], [0.0, max(left, 0.0)]]), 0.0, samples.total).nlml
