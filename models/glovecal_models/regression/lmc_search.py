"""The search for LMC-GPR's maximum-likelihood optimum, up to where it becomes expensive and from there on.

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

from glovecal_models.covariance.squared_exponential import SquaredExponentialArd
from glovecal_models.errors import NotTrainable
from glovecal_models.progress import Cancel, stop_if
from glovecal_models.regression.exact_profiled_likelihood import ExactProfiledLikelihood, TrainingProcess
from glovecal_models.regression.merged_samples import MergedSamples
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
from glovecal_models.regression.training_samples import Standardised, check_samples, standardise

MOST_EXACT = 4000
"""Distinct inputs up to which an N x N matrix is formed; 128 MB each at this size."""


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
