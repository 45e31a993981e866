"""The regression problem that effects are judged on, as an effect with an own ``assess`` sees it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Protocol

import numpy as np

from glovecal_models.effects.base.limits import SignificanceLimits
from glovecal_models.effects.base.signals import Signals


class Problem(Protocol):
    """All joints on takes that were smoothed alike and sampled at even times."""

    @property
    def rotations(self) -> tuple[str, ...]: ...

    @property
    def signals(self) -> tuple[Signals, ...]:
        """One for each take, ``own`` (N, R)."""
        ...

    @property
    def unit_take(self) -> tuple[int, ...]:
        """The take of each unit."""
        ...

    @property
    def products(self) -> Sequence[Any]:
        """Each joint's static map of the measured angles: ``units`` (with ``base`` (N, P) and ``target``
        (N,), the joint's own sensor in degrees, of each unit), ``whole`` (P,) coefficients of all units,
        ``residual`` (N,) of each unit when it is held out, ``count`` (U,) rows of each unit."""
        ...

    @property
    def limits(self) -> SignificanceLimits:
        """What assessments of it are held against."""
        ...

    def units(self, joint: int) -> Iterator[tuple[int, np.ndarray]]:
        """Take and row indices of each unit of a joint."""
        ...

    def once(self, what: str, work: Callable[[], Any]) -> Any:
        """The result of ``work``, kept for whoever asks for the same again."""
        ...
