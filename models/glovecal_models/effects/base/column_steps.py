"""A slow cause in equal steps: what firmware that corrects by a coarse table leaves between its entries.

The error rises with the column and falls back at each entry, for all sensors at the same values. No smooth
curve follows that, and each entry may be passed only once; but one width and one edge explain every fall.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from glovecal_models.effects.base.signals import Settings, in_joint_units
from glovecal_models.errors import BadInput

IN_STEPS = "in_steps"
"""Where settings keep the width and the edge; without them the effect is smooth."""
FEWEST_OF_A_RANGE, MOST_OF_A_RANGE, APART = 2.5, 14.0, 0.15
"""Over the column's range. Fewer are a slow bend, as wearings and slips may look; between widths tried the
last edge moves by less than a sixth of a step."""
EDGES = 12
"""Tried of a step."""
FINER = 11
"""Widths, and edges of each, between the best and its neighbours."""
LEAST_SPREAD = 0.1
"""Of what lies within steps, as a standard deviation in steps (evenly spread: 0.29): narrower ones are hardly
passed in these takes."""
PIECES_OF_STEPS = 8
MOST_PIECES_OF_STEPS = 600
FEWEST_TAKES_OF_STEPS = 8
PRIOR_DEG = 6.0
"""Of the change within one step."""
ALL_DRAWS = 99
"""Permutations, all of which the takes as they were recorded must beat where an effect is learned."""


@dataclass(frozen=True)
class ColumnSteps:
    """Where a table's entries lie, in units of the column. Raises BadInput for what cannot be steps."""

    width: float
    edge: float

    def __post_init__(self) -> None:
        if not (0 < self.width < np.inf and np.isfinite(self.edge)):
            raise BadInput(
                f"steps of a column need a width above 0 and an edge, not {self.width} and {self.edge}"
            )

    @classmethod
    def of_settings(cls, settings: Settings) -> ColumnSteps | None:
        """None for a smooth effect. Raises BadInput."""
        if IN_STEPS not in settings:
            return None
        try:
            return cls(**{name: float(value) for name, value in settings[IN_STEPS].items()})
        except (AttributeError, TypeError, ValueError) as error:
            raise BadInput("not the steps of a column: they are missing, or no numbers") from error

    def to_settings(self) -> dict[str, Any]:
        return {IN_STEPS: asdict(self)}

    def within(self, value: np.ndarray) -> np.ndarray:
        """Where the column's values (...) lie within their step: -0.5 to 0.5."""
        return np.mod((value - self.edge) / self.width, 1.0) - 0.5


def step_columns(value: np.ndarray, own: np.ndarray, settings: Settings) -> np.ndarray:
    """(N, L, 2) of a column's values (N,) and joints (N, L): its place within the step, and that times the
    joint; (N, L, 0) for a smooth effect."""
    steps = ColumnSteps.of_settings(settings)
    if steps is None:
        return np.zeros((*own.shape, 0))
    within = steps.within(value)[:, None]
    return np.stack([np.broadcast_to(within, own.shape), within * in_joint_units(own, settings)], axis=2)


def step_prior_sd(settings: Settings) -> np.ndarray:
    """(2,) or (0,), degrees."""
    return np.full(2 if IN_STEPS in settings else 0, PRIOR_DEG)


def step_names(settings: Settings, column: str) -> tuple[str, ...]:
    """Of the weights of ``step_columns``."""
    steps = ColumnSteps.of_settings(settings)
    if steps is None:
        return ()
    per = f"step_of_{steps.width:.3g}[c.{column}]"
    return (f"offset_deg_per_{per}", f"gain_deg_per_{per}_and_sd")


@dataclass(frozen=True)
class StepSearch:
    """All widths and edges, tried on mean errors of pieces of takes."""

    column: np.ndarray
    """(T, P), the column's mean in each piece."""

    @staticmethod
    def pieces(takes: int) -> int:
        """Of each take; 0 where so many takes cannot show steps."""
        return min(PIECES_OF_STEPS, MOST_PIECES_OF_STEPS // takes) if takes >= FEWEST_TAKES_OF_STEPS else 0

    @cached_property
    def tried(self) -> tuple[ColumnSteps, ...]:
        """Every width and edge."""
        counts = np.arange(FEWEST_OF_A_RANGE, MOST_OF_A_RANGE, APART)
        return self._passed(counts, np.arange(EDGES) / EDGES)

    def _passed(self, counts: np.ndarray, edges: np.ndarray) -> tuple[ColumnSteps, ...]:
        """So many steps over the range, each with its first edge at each share of a step; those that these
        takes pass."""
        low, span, values = float(self.column.min()), float(np.ptp(self.column)), self.column.ravel()
        if span <= 0:
            return ()
        every = [
            ColumnSteps(span / count, low + span / count * edge)
            for count in counts.tolist()
            for edge in edges.tolist()
        ]
        return tuple(item for item in every if item.within(values).std() >= LEAST_SPREAD)

    def _within(self, tried: Sequence[ColumnSteps]) -> np.ndarray:
        """(K, T P), centred and of length one."""
        values = np.array([item.within(self.column.ravel()) for item in tried])
        values -= values.mean(axis=1, keepdims=True)
        return values / np.linalg.norm(values, axis=1, keepdims=True)

    @cached_property
    def _all_within(self) -> np.ndarray:
        return self._within(self.tried)

    def best(self, errors: np.ndarray, orders: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(D,) places in ``tried`` and (D, J) shares of the square explained there, for the takes' ``errors``
        (J, T, P) in each of ``orders`` (D, T) beside the column as it is.

        The best explains most of all joints together: the sum of the likelihood's logarithms, each with a
        noise of its own.
        """
        explained = _explained(self._all_within, errors[:, orders])
        at = _of_all(explained).argmax(axis=0)
        return at, explained[at, :, np.arange(len(orders))]

    def refined(self, errors: np.ndarray, at: int) -> ColumnSteps:
        """The best near ``tried[at]`` for ``errors`` (J, T, P)."""
        found = self.tried[at]
        low, span = float(self.column.min()), float(np.ptp(self.column))
        counts = span / found.width + APART * np.linspace(-1, 1, FINER)
        edges = (found.edge - low) / found.width + np.linspace(-1, 1, FINER) / EDGES
        near = (found, *self._passed(counts, edges))
        return near[int(_of_all(_explained(self._within(near), errors[:, None])).argmax())]


def _explained(within: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """(K, J, D) shares of the square of errors (J, D, T, P) that each of ``within`` (K, T P) explains."""
    joints, draws = errors.shape[:2]
    target = errors.reshape(joints * draws, -1)
    target = target - target.mean(axis=1, keepdims=True)
    target /= np.maximum(np.linalg.norm(target, axis=1, keepdims=True), 1e-12)
    return np.minimum((within @ target.T) ** 2, 1.0 - 1e-9).reshape(len(within), joints, draws)


def _of_all(explained: np.ndarray) -> np.ndarray:
    """(K, D) of shares (K, J, D)."""
    return -np.log1p(-explained).sum(axis=1)


def learned_steps(
    column: Sequence[np.ndarray],
    rows: Sequence[Sequence[np.ndarray]],
    left: Sequence[Sequence[np.ndarray]],
    seed: int = 0,
) -> ColumnSteps | None:
    """Those that explain more of what is ``left`` than of any permutation of the takes; None without.

    ``column`` (N,) of each take; of each joint and take the ``rows`` (M,) at which errors (M,) are left.
    """
    takes = len(column)
    count = StepSearch.pieces(takes)
    if count < 1:
        return None
    search = StepSearch(np.array([[part.mean() for part in np.array_split(take, count)] for take in column]))
    errors = np.full((len(left), takes, count), np.nan)
    for joint, (places, parts) in enumerate(zip(rows, left, strict=True)):
        for take, (place, part) in enumerate(zip(places, parts, strict=True)):
            piece = place * count // max(len(column[take]), 1)
            known = np.bincount(piece, minlength=count)
            if known.all():
                errors[joint, take] = np.bincount(piece, part, count) / known
    if not np.isfinite(errors).all() or not search.tried:
        return None
    generator = np.random.default_rng(seed)
    orders = np.array([np.arange(takes), *(generator.permutation(takes) for _ in range(ALL_DRAWS))])
    at, explained = search.best(errors, orders)
    of_all = -np.log1p(-explained).sum(axis=1)
    return search.refined(errors, int(at[0])) if of_all[0] > of_all[1:].max() else None
