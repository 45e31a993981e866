"""What every covariance function answers, and how they add up.

Derivatives come in adjoint form: a trainer hands over the derivative of its objective with respect to
the entries of the covariance matrix and gets it back with respect to the hyperparameters and the first
argument's points. Exact and sparse training share this, and neither ever holds an N x N x P array.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from glovecal_models.errors import DamagedArtifact

Pullback = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Weights (A, B) -> gradient of sum(weights * k(a, b)) by theta (P,) and by a (A, D)."""


class Covariance(ABC):
    """A covariance function k(a, b) of points a (A, D) and b (B, D) with hyperparameters theta (P,).

    Theta is unconstrained: positive hyperparameters are kept as natural logarithms. Objects hold only
    what is fixed before training (a polynomial's degree), so they can be shared freely.
    """

    kind: ClassVar[str]
    """The name under which artifacts know this covariance."""

    _kinds: ClassVar[dict[str, type[Covariance]]] = {}

    def __init_subclass__(cls, **arguments: Any) -> None:
        super().__init_subclass__(**arguments)
        Covariance._kinds[cls.kind] = cls

    @abstractmethod
    def parameter_names(self, dimensions: int) -> list[str]:
        """Names of theta's entries for inputs of ``dimensions`` columns; logarithms start with ``log_``."""

    @abstractmethod
    def initial(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """A sensible theta to start training from, for standardised x (N, D) and y (N,)."""

    @abstractmethod
    def with_pullback(
        self, theta: np.ndarray, a: np.ndarray, b: np.ndarray, out: np.ndarray | None = None
    ) -> tuple[np.ndarray, Pullback]:
        """The matrix k(a, b) (A, B), C-ordered, in ``out`` if given, and its pullback.

        The pullback may still need the returned matrix: copy it before overwriting it.
        For a matrix k(a, a) with symmetric weights the gradient by a is twice the pullback's.
        """

    @abstractmethod
    def diagonal(self, theta: np.ndarray, a: np.ndarray) -> np.ndarray:
        """k(a_i, a_i), shape (A,)."""

    @abstractmethod
    def diagonal_pullback(
        self, theta: np.ndarray, a: np.ndarray, weights: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Gradient of sum(weights * diagonal(theta, a)) by theta (P,) and by a (A, D); weights (A,)."""

    @abstractmethod
    def scaled(self, theta: np.ndarray, factor: float) -> np.ndarray:
        """The theta whose covariance is ``factor`` (> 0) times that of ``theta``."""

    def bounds(self, dimensions: int) -> list[tuple[float, float]]:
        """The range training searches for each entry of theta, in standardised units."""
        return [(-14.0, 10.0)] * len(self.parameter_names(dimensions))

    def __call__(self, theta: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return self.with_pullback(theta, a, b)[0]

    def pullback(
        self, theta: np.ndarray, a: np.ndarray, b: np.ndarray, weights: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Gradient of sum(weights * k(a, b)) by theta (P,) and by a (A, D); weights (A, B)."""
        return self.with_pullback(theta, a, b)[1](weights)

    def parts(self) -> tuple[Covariance, ...]:
        """The terms of a sum; a covariance that is no sum is its own only part."""
        return (self,)

    def __add__(self, other: Covariance) -> Sum:
        return Sum((*self.parts(), *other.parts()))

    def settings(self) -> dict[str, Any]:
        """What ``restore_covariance`` needs, JSON-able."""
        return {"kind": self.kind}

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Covariance:
        """Inverse of ``settings`` for this kind; raises DamagedArtifact."""
        return cls()

    def __repr__(self) -> str:
        return f"{type(self).__name__}()"


class Sum(Covariance):
    """The sum of covariances: functions of that covariance are sums of independent functions."""

    kind = "sum"

    def __init__(self, terms: Sequence[Covariance]) -> None:
        self._terms = tuple(terms)

    def parts(self) -> tuple[Covariance, ...]:
        return self._terms

    def parameter_names(self, dimensions: int) -> list[str]:
        return [
            f"{number}.{term.kind}.{name}"
            for number, term in enumerate(self._terms, 1)
            for name in term.parameter_names(dimensions)
        ]

    def initial(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """The terms' own starts; a repeated kind starts elsewhere, else the two would move as one."""
        seen: dict[str, int] = {}
        thetas = []
        for term in self._terms:
            repetition = seen.get(term.kind, 0)
            seen[term.kind] = repetition + 1
            thetas.append(term.initial(x, y) + 1.5 * repetition)
        return np.concatenate(thetas)

    def with_pullback(
        self, theta: np.ndarray, a: np.ndarray, b: np.ndarray, out: np.ndarray | None = None
    ) -> tuple[np.ndarray, Pullback]:
        values = np.empty((len(a), len(b))) if out is None else out
        values[:] = 0.0
        pullbacks: list[Pullback] = []
        for term, part in zip(self._terms, self._split(theta, a.shape[1]), strict=True):
            matrix, pullback = term.with_pullback(part, a, b)
            values += matrix
            pullbacks.append(pullback)
        return values, lambda weights: _collect(pullback(weights) for pullback in pullbacks)

    def diagonal(self, theta: np.ndarray, a: np.ndarray) -> np.ndarray:
        split = zip(self._terms, self._split(theta, a.shape[1]), strict=True)
        return np.sum([term.diagonal(part, a) for term, part in split], axis=0)

    def diagonal_pullback(
        self, theta: np.ndarray, a: np.ndarray, weights: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        split = zip(self._terms, self._split(theta, a.shape[1]), strict=True)
        return _collect(term.diagonal_pullback(part, a, weights) for term, part in split)

    def scaled(self, theta: np.ndarray, factor: float) -> np.ndarray:
        dimensions = self._dimensions(len(theta))
        split = zip(self._terms, self._split(theta, dimensions), strict=True)
        return np.concatenate([term.scaled(part, factor) for term, part in split])

    def bounds(self, dimensions: int) -> list[tuple[float, float]]:
        return [bound for term in self._terms for bound in term.bounds(dimensions)]

    def settings(self) -> dict[str, Any]:
        return {"kind": self.kind, "terms": [term.settings() for term in self._terms]}

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Covariance:
        terms = settings.get("terms")
        if not isinstance(terms, list) or not 1 <= len(terms) <= 16:
            raise DamagedArtifact(
                f"covariance sum: terms is {terms!r}, expected a list of 1 to 16 covariances"
            )
        if any(isinstance(term, Mapping) and term.get("kind") == cls.kind for term in terms):
            raise DamagedArtifact("covariance sum: a term is itself a sum; sums are stored flat")
        return cls([restore_covariance(term) for term in terms])

    def __repr__(self) -> str:
        return " + ".join(map(repr, self._terms))

    def _split(self, theta: np.ndarray, dimensions: int) -> list[np.ndarray]:
        lengths = [len(term.parameter_names(dimensions)) for term in self._terms]
        return np.split(theta, np.cumsum(lengths)[:-1])

    def _dimensions(self, parameters: int) -> int:
        """The number of input columns for which theta has ``parameters`` entries (any, if none depends)."""
        for dimensions in range(1, parameters + 1):
            if len(self.parameter_names(dimensions)) == parameters:
                return dimensions
        raise ValueError(f"{self!r} has no theta of {parameters} entries")


def restore_covariance(settings: Any) -> Covariance:
    """The covariance that gave ``settings``; raises DamagedArtifact on an unknown kind."""
    from glovecal_models.covariance import functions  # noqa: F401  what is imported is registered by its kind

    if not isinstance(settings, Mapping):
        raise DamagedArtifact(f"covariance settings are {settings!r}, expected an object with a kind")
    covariance = Covariance._kinds.get(str(settings.get("kind")))
    if covariance is None:
        known = ", ".join(sorted(Covariance._kinds))
        raise DamagedArtifact(f"covariance kind {settings.get('kind')!r} is not known; known are {known}")
    return covariance.from_settings(settings)


def _collect(gradients: Any) -> tuple[np.ndarray, np.ndarray]:
    """Thetas' gradients side by side, points' gradients added."""
    by_theta, by_points = zip(*gradients, strict=True)
    return np.concatenate(by_theta), np.sum(by_points, axis=0)
