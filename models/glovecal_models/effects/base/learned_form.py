"""The learned form of an effect: what physics leaves open, a smooth function of the effect's inputs.

An effect says which signals act; whether they act in proportion, one-sidedly, up to a limit or only together
with the joint's own angle is learned. Each term is a Gaussian process of one or two inputs with a
squared-exponential kernel, in the reduced-rank basis of Solin and Saerkkae (2020, Statistics and Computing
30:419): sines on a box a little larger than what training saw, each with the standard deviation of its weight
from the kernel's spectral density. It is linear in its weights, and of fixed cost frame by frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from glovecal_models.effects.base.signals import on_lanes
from glovecal_models.errors import BadInput

OWN = "own"
"""The joint's own signal as an input."""
BOX = 1.6
"""Half-width of the box, in half ranges of training."""
REACH = 1.3
"""Inputs are followed so far, in half ranges; beyond they are held, and the variance is the prior's."""
LEAST_SD_SHARE = 0.03
"""Of the largest weight's standard deviation: sines that are expected smaller are left out."""
LEAST_HALF_RANGE = 1e-6
MOST_SINES = 24
MOST_INPUTS = 3
"""Of one effect on one joint."""
LARGEST_DOCUMENT = 16
"""Terms that a stored form may have."""


def sines(place: np.ndarray, count: int) -> np.ndarray:
    """(count, ...): of 1 to ``count`` half waves in the box, at ``place`` (...).

    Each from the two before it: a sine costs ten times a product. Inputs held within ``REACH`` keep away from
    the ends of the box, where this would lose digits.
    """
    angle = (0.5 * np.pi / BOX) * (place + BOX)
    twice = 2.0 * np.cos(angle)
    found = np.empty((count, *place.shape))
    found[0] = np.sin(angle) / np.sqrt(BOX)
    if count > 1:
        np.multiply(twice, found[0], out=found[1])
    for number in range(2, count):
        np.multiply(twice, found[number - 1], out=found[number])
        found[number] -= found[number - 2]
    return found


@lru_cache(maxsize=64)
def _needed_sines(dimensions: int, lengthscale: float, sd_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of half waves (K, D) that a term needs, and the standard deviations (K,) of their weights: from
    the spectral density at each frequency. Kept, since a choice of forms makes the same terms many times."""
    numbers = np.arange(1, MOST_SINES + 1)
    if dimensions == 1:
        every = numbers[:, None]
    else:
        every = np.stack(np.meshgrid(numbers, numbers, indexing="ij"), axis=-1).reshape(-1, 2)
    frequency = np.pi * every / (2 * BOX)
    density = (np.sqrt(2 * np.pi) * lengthscale) ** dimensions
    square = density * np.exp(-0.5 * lengthscale**2 * np.sum(frequency**2, axis=1))
    sd = sd_deg * np.sqrt(square)
    is_needed = sd >= LEAST_SD_SHARE * sd.max()
    found = every[is_needed], sd[is_needed]
    for array in found:
        array.setflags(write=False)
    return found


@dataclass(frozen=True)
class FormTerm:
    """One Gaussian process of one or two inputs."""

    inputs: tuple[str, ...]
    lengthscale: float
    """In half ranges of training."""
    sd_deg: float
    """Standard deviation of the function before any data, degrees."""

    @cached_property
    def half_waves(self) -> np.ndarray:
        """(K, D) numbers of half waves in the box, of each input."""
        return _needed_sines(len(self.inputs), self.lengthscale, self.sd_deg)[0]

    @property
    def count(self) -> int:
        """Columns."""
        return len(self.half_waves)

    @cached_property
    def weight_sd(self) -> np.ndarray:
        """(K,) by which columns are multiplied, so that every weight is expected to be of size one."""
        return _needed_sines(len(self.inputs), self.lengthscale, self.sd_deg)[1]

    @cached_property
    def most_sines(self) -> int:
        """How many sines of an input it needs."""
        return int(self.half_waves.max())

    def columns(self, place: Sequence[np.ndarray]) -> np.ndarray:
        """(N, L, K) of each input's place (N, L), -1 to 1 over the range of training."""
        return np.moveaxis(self.of_sines([sines(values, self.most_sines) for values in place]), 0, -1)

    def of_sines(self, every: Sequence[np.ndarray]) -> np.ndarray:
        """(K, ...) of each input's sines (``most_sines`` or more, ...)."""
        sd = self.weight_sd.reshape(-1, *(1 for _ in every[0].shape[1:]))
        if len(every) == 1:  # the first ones, one after another
            return every[0][: self.count] * sd
        one, other = every
        product = np.empty((self.count, *one.shape[1:]))
        first = 0
        for number, others in enumerate(np.bincount(self.half_waves[:, 0])[1:].tolist()):
            np.multiply(one[number], other[:others], out=product[first : first + others])
            first += others
        return np.multiply(product, sd, out=product)

    def to_document(self) -> dict[str, Any]:
        return {"inputs": list(self.inputs), "lengthscale": self.lengthscale, "sd_deg": self.sd_deg}

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> FormTerm:
        """Raises BadInput."""
        inputs = tuple(str(name) for name in document["inputs"])
        lengthscale, sd_deg = float(document["lengthscale"]), float(document["sd_deg"])
        if len(inputs) not in (1, 2) or not 0.05 <= lengthscale <= 100 or not 0 < sd_deg <= 360:
            raise BadInput(
                f"a term of a learned form has 1 or 2 inputs, a lengthscale of 0.05 to 100 and a standard"
                f" deviation up to 360 degrees, not {len(inputs)}, {lengthscale:g} and {sd_deg:g}"
            )
        return cls(inputs, lengthscale, sd_deg)


@dataclass(frozen=True)
class LearnedForm:
    """The terms of one effect, the same on all of its lanes; their weights are each lane's own."""

    terms: tuple[FormTerm, ...]
    low: Mapping[str, tuple[float, ...]]
    """For each input the smallest value in training, of each lane."""
    high: Mapping[str, tuple[float, ...]]

    @property
    def count(self) -> int:
        """Columns."""
        return sum(term.count for term in self.terms)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names, the joint's own signal left out."""
        return tuple(dict.fromkeys(name for term in self.terms for name in term.inputs if name != OWN))

    @classmethod
    def over(cls, terms: Sequence[FormTerm], takes: Sequence[Mapping[str, np.ndarray]]) -> LearnedForm:
        """With the ranges of ``takes``: for each the values (N, L) of every input by name."""
        names = dict.fromkeys(name for term in terms for name in term.inputs)
        known = [take for take in takes if all(len(values) for values in take.values())]
        return cls(
            tuple(terms),
            {name: tuple(np.min([take[name].min(axis=0) for take in known], axis=0)) for name in names},
            {name: tuple(np.max([take[name].max(axis=0) for take in known], axis=0)) for name in names},
        )

    def columns(self, inputs: Mapping[str, np.ndarray]) -> np.ndarray:
        """(N, L, C) in degrees for a weight of one, from the values (N, L) of every input."""
        every = {
            name: sines(
                self.place(name, inputs[name]), max(t.most_sines for t in self.terms if name in t.inputs)
            )
            for name in self.low
        }
        found = [term.of_sines([every[name] for name in term.inputs]) for term in self.terms]
        return np.moveaxis(np.concatenate(found), 0, -1)

    def place(self, name: str, values: np.ndarray) -> np.ndarray:
        """(N, L) of an input's values (N, L): -1 to 1 over the range of training, held a little beyond."""
        low, high = (np.array(on_lanes(end[name], values.shape[1])) for end in (self.low, self.high))
        half = np.maximum((high - low) / 2, LEAST_HALF_RANGE)
        return np.clip((values - (low + high) / 2) / half, -REACH, REACH)

    def of_lane(self, lane: int) -> LearnedForm:
        """The same with the range of one lane."""
        low, high = (
            {name: values[lane : lane + 1] for name, values in end.items()} for end in (self.low, self.high)
        )
        return LearnedForm(self.terms, low, high)

    def to_document(self) -> dict[str, Any]:
        """Plain data, as it stands in an effect's settings."""
        return {
            "terms": [term.to_document() for term in self.terms],
            "low": {name: list(map(float, values)) for name, values in self.low.items()},
            "high": {name: list(map(float, values)) for name, values in self.high.items()},
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> LearnedForm:
        """Inverse of ``to_document``. Raises BadInput."""
        try:
            if not 0 < len(document["terms"]) <= LARGEST_DOCUMENT:
                raise BadInput(f"a learned form has 1 to {LARGEST_DOCUMENT} terms")
            low, high = (
                {str(name): tuple(map(float, values)) for name, values in document[end].items()}
                for end in ("low", "high")
            )
            terms = tuple(FormTerm.from_document(item) for item in document["terms"])
        except BadInput:
            raise
        except (KeyError, TypeError, ValueError) as error:
            raise BadInput("not a learned form: something in it is missing, or no number") from error
        named = {name for term in terms for name in term.inputs}
        if set(low) != named or set(high) != named:
            raise BadInput(f"a learned form of {sorted(named)} has ranges of {sorted(low)}")
        return cls(terms, low, high)
