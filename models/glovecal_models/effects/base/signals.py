"""What effects look at: the signals of a take, or of the next frame of several gloves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, overload

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.takes.take import KnownLatency

Settings = dict[str, Any]
"""Constants an effect takes from its training takes: plain JSON-able data."""


@dataclass(frozen=True)
class Signals:
    """What effects may look at in one take: N frames of L lanes."""

    time_s: np.ndarray
    """(N,), seconds, increasing."""
    own: np.ndarray
    """(N, L), degrees: each joint's own signal, measured (forward) or predicted without effects (inverse)."""
    others: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Other signals (N,) by name: neighbouring sensors or joints, in standard deviations."""
    context: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Context columns (N,) by name; NaN where unknown."""
    wearing: str = ""
    take: str = ""
    """Name of the take; it may tell which motion was done."""
    zero_deg: np.ndarray | None = None
    """(L,): where on the scale of ``own`` a raw reading of zero lies, by a straight line; None if unknown."""
    glove_latency: KnownLatency | None = None
    """How late the glove is known to be; None if nobody measured it."""

    def __len__(self) -> int:
        return len(self.time_s)

    def at(self, rows: np.ndarray | slice) -> Signals:
        """Some of its frames."""
        return replace(
            self,
            time_s=self.time_s[rows],
            own=self.own[rows],
            others={name: values[rows] for name, values in self.others.items()},
            context={name: values[rows] for name, values in self.context.items()},
        )


class GloveFrames(Sequence[Signals]):
    """The next frame of each of G gloves that share a model; item i is that of glove i, as signals."""

    def __init__(
        self,
        time_s: np.ndarray,
        own: np.ndarray,
        others: Callable[[], Mapping[str, np.ndarray]],
        context: Sequence[Mapping[str, float]],
        wearing: Sequence[str],
        zero_deg: np.ndarray | None,
    ) -> None:
        """``time_s`` (G,) on each glove's own clock, ``own`` (G, L); ``others`` gives signals (G,) by name
        and is asked when they are needed; what follows is as in ``Signals``, glove by glove."""
        self.time_s: np.ndarray = time_s
        self.own: np.ndarray = own
        self._others = others
        self._context, self._wearing, self._zero_deg = context, wearing, zero_deg

    def __len__(self) -> int:
        return len(self.time_s)

    @overload
    def __getitem__(self, at: int) -> Signals: ...
    @overload
    def __getitem__(self, at: slice) -> list[Signals]: ...
    def __getitem__(self, at: int | slice) -> Signals | list[Signals]:
        if isinstance(at, slice):
            return [self[index] for index in range(len(self))[at]]
        others = {name: values[at : at + 1] for name, values in self._others().items()}
        context = {name: np.array([value]) for name, value in self._context[at].items()}
        own, time_s = self.own[at : at + 1], self.time_s[at : at + 1]
        return Signals(time_s, own, others, context, self._wearing[at], zero_deg=self._zero_deg)

    def as_one(self) -> Signals | None:
        """All gloves as the frames of one take, for what has no memory; None if not in one wearing and with
        the same context columns."""
        wearing, names = self._wearing[0], self._context[0].keys()
        if any(other != wearing for other in self._wearing) or any(c.keys() != names for c in self._context):
            return None
        context = {name: np.array([of_glove[name] for of_glove in self._context]) for name in names}
        return Signals(self.time_s, self.own, self._others(), context, wearing, zero_deg=self._zero_deg)


def as_slice(rows: np.ndarray) -> np.ndarray | slice:
    """Evenly rising or falling rows (N,) as a slice, which copies nothing."""
    step = int(rows[1] - rows[0]) if len(rows) > 1 else 0
    if step == 0 or not (np.diff(rows) == step).all():
        return rows
    end = int(rows[-1]) + (1 if step > 0 else -1)
    return slice(int(rows[0]), end if end >= 0 else None, step)


# Joints in their own standard deviations, so that gains of all joints are of one size.


def fit_joint_units(takes: Sequence[Signals]) -> Settings:
    """Centre and scale of each lane, degrees, to be stored with an effect's settings.

    Takes without a row say nothing; at least one has some.
    """
    own = [take.own for take in takes if len(take)]
    return {
        "own_centre_deg": np.mean([part.mean(axis=0) for part in own], axis=0).tolist(),
        "own_scale_deg": np.sqrt(np.mean([part.var(axis=0) for part in own], axis=0)).tolist(),
    }


def in_joint_units(own: np.ndarray, settings: Settings) -> np.ndarray:
    """(..., L) standard deviations from the centre; lanes may be the settled ones several times over."""
    lanes = own.shape[-1]
    scale = on_lanes(settings["own_scale_deg"], lanes)
    return (own - on_lanes(settings["own_centre_deg"], lanes)) / np.maximum(scale, 1e-6)


def on_lanes(settled: Sequence[float], lanes: int) -> np.ndarray:
    """(lanes,): the settled values, repeated as a whole while several shapes are tried at once.

    Raises BadInput when ``lanes`` is not a multiple of what was settled.
    """
    if lanes % len(settled):
        raise BadInput(f"settings of {len(settled)} lanes were given signals of {lanes}; settle them anew")
    return np.tile(settled, lanes // len(settled))
