"""The base of a diagnosis: a static map of a joint's inputs, flexible enough to stand for its regressor.

The first input alone in Legendre polynomials; further inputs with products (total degree), as facts found
that a missing product is taken for another effect. Linear in its coefficients, so that leaving takes out
costs next to nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from math import comb

import numpy as np

OWN_DEGREE = 7
TOTAL_DEGREE = {1: 0, 2: 4, 3: 4, 4: 3, 5: 2}
"""Of products, by the number of inputs; 2 above."""
ROWS_PER_COLUMN = 10
"""Fewer rows do not carry so many products."""


@dataclass(frozen=True)
class BaseFeatures:
    """Scales inputs to -1..1 over the training takes and expands them."""

    centre: np.ndarray
    half: np.ndarray
    linear: bool
    degree: int = 0
    """Of products."""

    @classmethod
    def settle(cls, inputs: Sequence[np.ndarray], *, linear: bool = False) -> BaseFeatures:
        """``inputs``: for each take (N, D), the measuring sensor first."""
        low = np.min([part.min(axis=0) for part in inputs if len(part)], axis=0)
        high = np.max([part.max(axis=0) for part in inputs if len(part)], axis=0)
        rows, dimensions = sum(map(len, inputs)), len(low)
        degree = TOTAL_DEGREE.get(dimensions, 2)
        while degree > 1 and comb(dimensions + degree, degree) > rows / ROWS_PER_COLUMN:
            degree -= 1
        return cls((low + high) / 2, np.maximum((high - low) / 2, 1e-9), linear, degree)

    def columns(self, inputs: np.ndarray) -> np.ndarray:
        """(N, P), the first column ones."""
        x = np.clip((inputs - self.centre) / self.half, -1.5, 1.5)
        if self.linear:
            return np.column_stack([np.ones(len(x)), x])
        own = np.polynomial.legendre.legvander(x[:, 0], OWN_DEGREE)
        dimensions = x.shape[1]
        degree = self.degree
        powers = [np.polynomial.legendre.legvander(x[:, d], max(degree, 1)) for d in range(dimensions)]
        extra = []
        for total in range(1, degree + 1):
            for chosen in combinations_with_replacement(range(dimensions), total):
                if set(chosen) == {0}:
                    continue
                product = np.ones(len(x))
                for d in set(chosen):
                    product = product * powers[d][:, chosen.count(d)]
                extra.append(product)
        return np.column_stack([own, *extra])
