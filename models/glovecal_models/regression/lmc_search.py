"""The search for LMC-GPR's maximum-likelihood optimum, up to where it becomes expensive and from there on.

Nodes make a search's cost independent of N. Where short lengthscales need too many of them, exact evaluations
with all samples follow, a quarter of a second each for 2000: whoever may not need them can stop before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from glovecal_models.errors import Cancelled
from glovecal_models.regression.merged_samples import MergedSamples
from glovecal_models.regression.multi_start import (
    FEW,
    MOST_NODES,
    SAME_OPTIMUM,
    SCREENED,
    Candidate,
    descend,
    screen,
    search_exactly,
    some_samples,
)
from glovecal_models.regression.standardise import Standardised, standardise
from glovecal_models.regression.training_check import check_samples

MOST_EXACT = 4000
"""Distinct inputs up to which an N x N matrix is formed; 128 MB each at this size."""
Cancel = Callable[[], bool] | None


@dataclass(frozen=True)
class LmcSearch:
    """Starts compared and, where nodes suffice, the best refined."""

    standard: Standardised
    samples: MergedSamples
    sample_weight: float
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
        seed: int = 0,
        cancelled: Cancel = None,
    ) -> LmcSearch:
        """From ``inputs`` (N, D), counts, and ``target`` (N,), degrees. Raises NotTrainable, Cancelled."""
        standard = standardise(*check_samples(inputs, target))
        samples = MergedSamples.of(standard.x, standard.y, sample_weight)
        generator = np.random.default_rng(seed)
        found, account = screen(samples, standard.x, standard.y, generator, cancelled, sample_weight)
        on_nodes, distinct = None, len(samples.inputs)
        if distinct > FEW:
            nodes = min(MOST_NODES, distinct // 2)
            on_nodes = descend(samples, found[0].parameters, fine=True, most_nodes=nodes, cancelled=cancelled)
        return cls(standard, samples, sample_weight, tuple(found), account, on_nodes, generator)

    @property
    def is_expensive(self) -> bool:
        """Whether what is left takes exact evaluations with many samples."""
        return self.on_nodes is None and len(self.samples.inputs) > 2 * SCREENED

    def optimum(self, cancelled: Cancel = None) -> Candidate:
        """Refine the most promising optimum; others too while that is cheap, which exact searches are not."""
        best = self.on_nodes or self._refined_exactly(cancelled)
        for candidate in self.found[1:3] if len(self.samples.inputs) <= MOST_EXACT or best.low_rank else ():
            if cancelled is not None and cancelled():
                raise Cancelled("training was cancelled")
            if np.abs(candidate.parameters - best.parameters).max() < SAME_OPTIMUM:
                continue
            nodes = min(MOST_NODES, len(self.samples.inputs))
            rival = descend(
                self.samples, candidate.parameters, fine=True, most_nodes=nodes, cancelled=cancelled
            )
            if rival is not None and rival.nlml < best.nlml - 1e-3:
                best = rival
        return best

    def _refined_exactly(self, cancelled: Cancel) -> Candidate:
        """By exact evaluations, to 1e-6 nats of few samples and 1e-3 of many; from some of very many.

        They start from the optimum of a subset, where an evaluation costs a fifteenth.
        """
        samples, rough, standard = self.samples, self.found[0], self.standard
        distinct, weight = len(samples.inputs), self.sample_weight
        if distinct <= FEW:
            return search_exactly(samples, rough.parameters, tolerance=1e-6, cancelled=cancelled) or rough
        if distinct > MOST_EXACT:
            samples = some_samples(standard.x, standard.y, 2000, self.generator, weight)
        if len(samples.inputs) > 2 * SCREENED:
            subset = some_samples(standard.x, standard.y, SCREENED, self.generator, weight)
            rough = search_exactly(subset, rough.parameters, tolerance=0.05, cancelled=cancelled) or rough
        return search_exactly(samples, rough.parameters, tolerance=1e-3, cancelled=cancelled) or rough
