"""From several starts to the best optimum of the profiled likelihood, as cheaply as each start allows.

The likelihood of a cross-coupled joint has several optima, some with short lengthscales, so one start is
not enough. Long lengthscales are searched on few nodes (``LowRankLikelihood``), whose number does not depend
on N. Short ones in several dimensions need too many nodes; a random subset of the samples shows where they
lead.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.progress import Cancel
from glovecal_models.regression.optimise import SearchResult, newton_search
from glovecal_models.regression.profiled_likelihood import ExactProfiledLikelihood, LowRankLikelihood
from glovecal_models.regression.training_samples import MergedSamples

LONGEST_LENGTHSCALE, LARGEST_LOG_RHO, SMALLEST_LOG_RHO, SHORTEST_LENGTHSCALE = 60.0, 12.0, -18.0, 0.02
SCREENED = 800
"""Samples on which starts are compared; the best go on with all."""
SCREENING_NODES = 200
SUBSET = 200
"""Samples on which short lengthscales are tried first, exactly."""
SAME_OPTIMUM, HOPELESS = 0.25, 5.0
"""Largest difference of log parameters, and nats of the screening, by which optima are told apart."""
FEW = 260
"""With no more distinct inputs than this, exact evaluations are cheap enough for every start."""
MOST_NODES = 420
"""Beyond this rank an exact evaluation is not much dearer than a low-rank one."""
REBUILDS = 8


@dataclass(frozen=True)
class Candidate:
    """An optimum reached from a start; NLML of the likelihood it was searched with."""

    parameters: np.ndarray
    nlml: float
    evaluations: int
    low_rank: bool
    """Searched on nodes for all samples, as against exactly or on a subset."""


def lower_bounds(dimensions: int) -> np.ndarray:
    return np.append(np.full(dimensions, np.log(SHORTEST_LENGTHSCALE)), SMALLEST_LOG_RHO)


def upper_bounds(dimensions: int) -> np.ndarray:
    return np.append(np.full(dimensions, np.log(LONGEST_LENGTHSCALE)), LARGEST_LOG_RHO)


def long_starts(dimensions: int) -> Iterator[np.ndarray]:
    """Smooth functions, all inputs alike or one more relevant than the others."""
    yield np.append(np.full(dimensions, np.log(3.0)), np.log(0.1))
    if dimensions == 1:
        yield np.log([1.0, 0.01])
        yield np.log([0.3, 0.3])
        yield np.log([0.1, 1.0])
        return
    for short in range(min(dimensions, 4)):
        lengthscales = np.full(dimensions, 4.0)
        lengthscales[short] = 1.0
        yield np.append(np.log(lengthscales), np.log(0.3))


def short_start(dimensions: int) -> np.ndarray:
    return np.append(np.full(dimensions, np.log(0.4)), np.log(0.3))


def descend(
    samples: MergedSamples,
    start: np.ndarray,
    *,
    fine: bool,
    most_nodes: int = MOST_NODES,
    cancelled: Cancel | None = None,
) -> Candidate | None:
    """Search on nodes, choosing them anew whenever lengthscales or noise leave the range they serve.

    None when more than ``most_nodes`` would be needed. ``fine`` makes the result good to 1e-4 nats,
    else to some hundredths.
    """
    dimensions = len(start) - 1
    point, evaluations, reach, nlml = start, 0, 0.8 if fine else 0.6, np.inf
    for _ in range(REBUILDS):
        lower = np.append(point[:-1] + np.log(reach), point[-1] - (1.5 if fine else 2.5))
        lower = np.maximum(lower, lower_bounds(dimensions))
        tolerance = (1e-5 if fine else 1e-2) * float(np.exp(lower[-1]))
        likelihood = LowRankLikelihood.at(
            samples, np.exp(lower[:-1]), float(np.clip(tolerance, 1e-12, 1e-3)), most_nodes
        )
        if likelihood is None:
            return None
        found = newton_search(
            likelihood.evaluate,
            point,
            lower,
            upper_bounds(dimensions),
            tolerance=1e-5 if fine else 2e-2,
            evaluations=60 if fine else 40,
            cancelled=cancelled,
        )
        if found is None:
            return None
        evaluations += found.evaluations
        held = (found.parameters < lower + 0.02) & (lower > lower_bounds(dimensions))
        point, nlml = found.parameters, found.nlml
        if not held.any():
            break
        reach = 0.8 if fine else 0.5
    return Candidate(point, nlml, evaluations, low_rank=True)


def search_exactly(
    samples: MergedSamples,
    start: np.ndarray,
    *,
    tolerance: float,
    cancelled: Cancel | None = None,
) -> Candidate | None:
    """Search the exact likelihood of ``samples``."""
    found = newton_search(
        ExactProfiledLikelihood(samples).evaluate,
        start,
        lower_bounds(len(start) - 1),
        upper_bounds(len(start) - 1),
        tolerance=tolerance,
        evaluations=60,
        cancelled=cancelled,
    )
    return _candidate(found)


def screen(
    merged: MergedSamples,
    x: np.ndarray,
    y: np.ndarray,
    generator: np.random.Generator,
    cancelled: Cancel | None = None,
    weight: float = 1.0,
    precision: np.ndarray | None = None,
) -> tuple[list[Candidate], list[dict[str, object]]]:
    """Distinct optima over all starts, best first, roughly located; and a JSON-able account of every start.

    ``merged``: all of the standardised samples ``x`` (N, D), ``y`` (N,). Where these have many distinct
    inputs, a random ``SCREENED`` of them are used. ``weight``: what each sample counts in ``merged``;
    ``precision`` (N,): its noise's there.
    """
    dimensions = x.shape[1]
    few = len(merged.inputs) <= FEW
    samples = merged if few else some_samples(x, y, SCREENED, generator, weight, precision)
    found: list[Candidate] = []
    account: list[dict[str, object]] = []
    for start in long_starts(dimensions):
        nodes = min(SCREENING_NODES, len(samples.inputs))
        candidate = descend(samples, start, fine=few, most_nodes=nodes, cancelled=cancelled)
        _note(account, start, candidate)
        if candidate is not None:
            found.append(candidate)
    found.sort(key=lambda candidate: candidate.nlml)
    if dimensions > 1 or not found:
        subset = some_samples(x, y, SUBSET, generator, weight, precision)
        short = _short_optimum(subset, found, cancelled)
        _note(account, short_start(dimensions), short)
        if short is not None:
            found.insert(0, short)
    if not found:
        found.append(Candidate(short_start(dimensions), np.inf, 0, low_rank=False))
    return _distinct(found), account


def screen_one(
    merged: MergedSamples, start: np.ndarray, cancelled: Cancel | None = None
) -> tuple[list[Candidate], list[dict[str, object]]]:
    """The same from one start (D + 1,) that is nearly an optimum already."""
    account: list[dict[str, object]] = []
    candidate = None
    if len(merged.inputs) <= FEW:
        candidate = descend(merged, start, fine=True, most_nodes=SCREENING_NODES, cancelled=cancelled)
        _note(account, start, candidate)
    return [candidate or Candidate(start, np.inf, 0, low_rank=False)], account


def some_samples(
    x: np.ndarray,
    y: np.ndarray,
    most: int,
    generator: np.random.Generator,
    weight: float = 1.0,
    precision: np.ndarray | None = None,
) -> MergedSamples:
    """A random ``most`` of the samples, or all where there are fewer.

    Fewer are less alike: each counts for more, up to a whole one.
    """
    if len(y) > most:
        rows = generator.choice(len(y), most, replace=False)
        weight = min(1.0, weight * len(y) / most)
        x, y = x[rows], y[rows]
        precision = None if precision is None else precision[rows]
    return MergedSamples.of(x, y, weight, precision)


def _short_optimum(
    subset: MergedSamples, rivals: list[Candidate], cancelled: Cancel | None
) -> Candidate | None:
    """The optimum reached from short lengthscales, if it beats the best rival on ``subset``."""
    start = short_start(subset.inputs.shape[1])
    short = search_exactly(subset, start, tolerance=0.1, cancelled=cancelled)
    if short is None or not rivals:
        return short
    there = ExactProfiledLikelihood(subset).evaluate(rivals[0].parameters)
    if there is not None and there.nlml <= short.nlml + 1.0:
        return None
    return replace(short, nlml=rivals[0].nlml)


def _distinct(found: list[Candidate]) -> list[Candidate]:
    """Leave out optima that are another's, and those far worse than the best."""
    kept: list[Candidate] = []
    for candidate in found:
        near = any(np.abs(candidate.parameters - other.parameters).max() < SAME_OPTIMUM for other in kept)
        if not near and candidate.nlml < found[0].nlml + HOPELESS:
            kept.append(candidate)
    return kept


def _candidate(found: SearchResult | None) -> Candidate | None:
    if found is None:
        return None
    return Candidate(found.parameters, found.nlml, found.evaluations, low_rank=False)


def _note(account: list[dict[str, object]], start: np.ndarray, candidate: Candidate | None) -> None:
    entry: dict[str, object] = {"lengthscales": np.round(np.exp(start[:-1]), 3).tolist()}
    if candidate is None:
        entry["outcome"] = "left"
    else:
        entry["nlml"] = round(candidate.nlml, 4)
        entry["evaluations"] = candidate.evaluations
    account.append(entry)
