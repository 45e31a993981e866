"""Which form an effect takes: the smooth functions of its inputs that the takes at hand ask for.

Forward selection by the marginal likelihood of the weights (Rasmussen and Williams 2006, section 5.4.1): it
pays for every function with the freedom that the function has. Errors of neighbouring times are alike, so
that many rows count for one (``ALIKE_ROWS``), as everywhere where weights are fitted.

Terms of the same inputs are made of the same sines, the coarser ones of fewer and with other weights: their
products are formed once, for the finest that was asked for. What a term adds beside those chosen before is
told by its Schur complement in their Gram matrix, which all terms of the same inputs share too.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from typing import Any

import numpy as np

from glovecal_models.calibration.held_out import ALIKE_ROWS, LEAST_VARIANCE_DEG2, Rows
from glovecal_models.effects.base.learned_form import (
    MOST_INPUTS,
    MOST_SINES,
    OWN,
    FormTerm,
    LearnedForm,
    sines,
)
from glovecal_models.regression.factorisation import potrf, trtrs

Key = tuple[tuple[str, ...], float]
"""Inputs and lengthscale."""
OWN_COLUMNS: Key = ((), 0.0)
"""The effect's own columns."""


class FormEvidence:
    """Sums of products of one lane, the base's free columns projected out."""

    def __init__(
        self,
        free: np.ndarray,
        plain: np.ndarray,
        inputs: Mapping[str, np.ndarray],
        target: np.ndarray,
        *,
        alike_rows: float,
        least_variance: float,
    ) -> None:
        """``free`` (N, P), ``plain`` (C, N) for weights expected of size 1, each input (N, 1), ``target``
        (N,) degrees; so many ``alike_rows`` count for one, and the noise has ``least_variance`` at least."""
        self._alike_rows, self._least = alike_rows, least_variance
        self._free = np.linalg.qr(free)[0]
        ranges = LearnedForm.over([FormTerm((name,), 1.0, 1.0) for name in inputs], [inputs])
        self._place = {name: ranges.place(name, values)[:, 0] for name, values in inputs.items()}
        self._sines: dict[str, np.ndarray] = {}
        self._target = self._without_base(target)
        plain = self._without_base(plain)
        self._columns = {OWN_COLUMNS: plain}
        self._finest: dict[tuple[str, ...], float] = {}
        self._gram: dict[tuple[Key, Key], np.ndarray] = {}
        self._right: dict[Key, np.ndarray] = {}
        self._variance = max(float(self._target @ self._target) / len(self._target), self._least)
        self._terms = [_Part(OWN_COLUMNS, np.arange(len(plain)), np.ones(len(plain)))]
        self._chosen: _Chosen | None = None
        self._beside: dict[Key, tuple[np.ndarray, np.ndarray]] = {}

    def settle(self, terms: Sequence[FormTerm]) -> None:
        """Choose ``terms``, and take what they leave as the noise from now on."""
        self._terms = [self._terms[0], *(self._part(term) for term in terms)]
        gram, right = self._parts()
        for _ in range(2):
            weights = np.linalg.solve(gram + self._noise * np.eye(len(gram)), right)
            square = self._target @ self._target - 2 * weights @ right + weights @ gram @ weights
            self._variance = max(float(square) / len(self._target), self._least)
        self._forget()

    def share_noise(self, other: FormEvidence) -> None:
        self._variance = other._variance
        self._forget()

    def evidence(self) -> float:
        """The log marginal likelihood of the own columns and the terms chosen so far, nats, up to what all
        choices share."""
        return _log_likelihood(*self._so_far())

    def gain(self, term: FormTerm) -> float:
        """By how many nats it rises with one more term."""
        part = self._part(term)
        square, right = self._beside_chosen(part.key)
        some = square[np.ix_(part.places, part.places)] * part.scale[:, None] * part.scale
        some[np.diag_indices_from(some)] += 1.0
        factor = _factored(some)
        return _log_likelihood(factor, _solved_by(factor, right[part.places] * part.scale))

    @property
    def _noise(self) -> float:
        return self._alike_rows * self._variance

    def _forget(self) -> None:
        """What depends on the noise and on what is chosen."""
        self._chosen = None
        self._beside.clear()

    def _so_far(self) -> _Chosen:
        if self._chosen is None:
            gram, right = self._parts()
            inner = gram / self._noise
            inner[np.diag_indices_from(inner)] += 1.0
            factor = _factored(inner)
            self._chosen = factor, _solved_by(factor, right / self._noise)
        return self._chosen

    def _beside_chosen(self, key: Key) -> tuple[np.ndarray, np.ndarray]:
        """Gram matrix (K, K) and right side (K,) of columns, in units of the noise, less what own columns and
        chosen terms say of them."""
        if key not in self._beside:
            factor, solved = self._so_far()
            crossed = [
                self._product(part.key, key)[part.places] * part.scale[:, None] for part in self._terms
            ]
            told = _solved_by(factor, np.concatenate(crossed) / self._noise)
            square = self._product(key, key) / self._noise - told.T @ told
            self._beside[key] = square, self._with_target(key) / self._noise - told.T @ solved
        return self._beside[key]

    def _parts(self) -> tuple[np.ndarray, np.ndarray]:
        """Gram matrix and right side of own columns and chosen terms, for weights expected of size 1."""
        gram = np.block(
            [
                [
                    self._product(one.key, other.key)[np.ix_(one.places, other.places)]
                    * one.scale[:, None]
                    * other.scale
                    for other in self._terms
                ]
                for one in self._terms
            ]
        )
        right = [self._with_target(part.key)[part.places] * part.scale for part in self._terms]
        return gram, np.concatenate(right)

    def _part(self, term: FormTerm) -> _Part:
        """Where its columns stand among the finest of the same inputs."""
        finest = self._finest.get(term.inputs, np.inf)
        if term.lengthscale < finest:
            self._finest[term.inputs] = finest = term.lengthscale
        places, scale = _within(len(term.inputs), finest, term.lengthscale, term.sd_deg)
        return _Part((term.inputs, finest), places, scale)

    def _product(self, one: Key, other: Key) -> np.ndarray:
        if (one, other) not in self._gram:
            found = self._of(one) @ self._of(other).T
            self._gram[one, other], self._gram[other, one] = found, found.T
        return self._gram[one, other]

    def _with_target(self, key: Key) -> np.ndarray:
        if key not in self._right:
            self._right[key] = self._of(key) @ self._target
        return self._right[key]

    def _of(self, key: Key) -> np.ndarray:
        """(K, N): columns of a term of 1 degree, without what the base's columns can say."""
        if key not in self._columns:
            inputs, lengthscale = key
            term = FormTerm(inputs, lengthscale, 1.0)
            sines_of = [self._sines_of(name, term.most_sines) for name in inputs]
            self._columns[key] = self._without_base(term.of_sines(sines_of))
        return self._columns[key]

    def _sines_of(self, name: str, count: int) -> np.ndarray:
        """(``count`` or more, N) of an input, for terms of every lengthscale."""
        if len(self._sines.get(name, ())) < count:
            self._sines[name] = sines(self._place[name], count)
        return self._sines[name]

    def _without_base(self, columns: np.ndarray) -> np.ndarray:
        """``columns`` (..., N)."""
        return columns - (columns @ self._free) @ self._free.T


_Chosen = tuple[np.ndarray, np.ndarray]
"""Lower factor (K, K) of the Gram matrix of what is chosen, in units of the noise and with the prior's one,
and the right side (K,) solved by it."""


@dataclass(frozen=True)
class _Part:
    """The columns of one term."""

    key: Key
    """Of the columns that they are some of."""
    places: np.ndarray
    """(K,) among those."""
    scale: np.ndarray
    """(K,) by which those are multiplied, for weights expected of size 1."""


@lru_cache(maxsize=256)
def _within(
    dimensions: int, finest: float, lengthscale: float, sd_deg: float
) -> tuple[np.ndarray, np.ndarray]:
    """Where the columns of a term (K,) stand among those of the ``finest``, 1 degree, of the same inputs, and
    by what these are multiplied to be the term's."""
    inputs = ("",) * dimensions
    among, term = FormTerm(inputs, finest, 1.0), FormTerm(inputs, lengthscale, sd_deg)
    # One number for each row of numbers of half waves; both rise.
    base = (MOST_SINES + 1) ** np.arange(dimensions)[::-1]
    places = np.searchsorted(among.half_waves @ base, term.half_waves @ base)
    found = places, term.weight_sd / among.weight_sd[places]
    for array in found:
        array.setflags(write=False)
    return found


def _factored(inner: np.ndarray) -> np.ndarray:
    """Lower factor of a symmetric matrix. Raises LinAlgError."""
    factor, failed = potrf(inner, lower=1, clean=0)
    if failed:
        raise np.linalg.LinAlgError("the products of a form are not positive definite")
    return factor


def _solved_by(factor: np.ndarray, right: np.ndarray) -> Any:
    return trtrs(factor, right, lower=1)[0]


def _log_likelihood(factor: np.ndarray, solved: np.ndarray) -> float:
    return 0.5 * float(solved @ solved) - float(np.log(np.diagonal(factor)).sum())


EVERY = 3
"""Of the fitted rows: a form is chosen on a third of them."""
ALONE = (0.12, 0.3, 0.8)
"""Lengthscales of functions of one input, in half ranges."""
TOGETHER = (0.35, 0.8)
"""Of functions of two."""
SD_DEG = (2.0, 6.0)
LEAST_GAIN_NATS = 3.0
"""Of the log marginal likelihood; less is left to chance."""
MOST_TERMS = 5
MOST_SCREENED = 5
"""Inputs that are tried in every form: those that explain most in the smoothest."""


@dataclass(frozen=True)
class FormRows:
    """The fitted rows of one lane, all takes together."""

    free: np.ndarray
    """(N, P): columns of the base, whose weights are free."""
    plain: np.ndarray
    """(N, C): the effect's own columns and those of effects before it, with ``plain_sd`` (C,)."""
    plain_sd: np.ndarray
    inputs: Mapping[str, np.ndarray]
    """Each (N, 1)."""
    target: np.ndarray
    """(N,), degrees."""

    @classmethod
    def of(
        cls,
        base: Sequence[Rows],
        own: Sequence[np.ndarray],
        own_sd: np.ndarray,
        takes: Sequence[int],
        take_sd_deg: float,
        inputs: Sequence[Mapping[str, np.ndarray]] = (),
    ) -> FormRows:
        """Of several stretches, each of the take in ``takes``, every third row.

        ``own``: for each stretch (N, C), ``own_sd`` (C,); ``inputs``: for each stretch, each (N, 1). Where
        ``take_sd_deg`` is not zero, each take may have an offset of that size beside the effect.
        """
        plain = [part[::EVERY] for part in own]
        if take_sd_deg:
            different, which = np.unique(np.asarray(takes), return_inverse=True)
            offsets = np.eye(len(different))
            plain = [
                np.column_stack([part, np.repeat(offsets[[at]], len(part), axis=0)])
                for part, at in zip(plain, which, strict=True)
            ]
            own_sd = np.append(own_sd, np.full(len(different), take_sd_deg))
        return cls(
            np.concatenate([unit.base[::EVERY] for unit in base]),
            np.concatenate(plain),
            own_sd,
            {
                name: np.concatenate([part[name][::EVERY] for part in inputs])
                for name in (inputs[0] if inputs else ())
            },
            np.concatenate([unit.target[::EVERY] for unit in base]),
        )

    def evidence(self) -> FormEvidence:
        """For terms beside the own columns."""
        return FormEvidence(
            self.free,
            (self.plain * self.plain_sd).T,
            self.inputs,
            self.target,
            alike_rows=ALIKE_ROWS / EVERY,
            least_variance=LEAST_VARIANCE_DEG2,
        )


def chosen_form(lanes: Sequence[FormRows]) -> tuple[FormTerm, ...]:
    """The terms that the lanes of one effect share, at most three inputs; empty: its own columns are enough.

    Every lane has the same inputs, in units of its own range.
    """
    problems = [lane.evidence() for lane in lanes if len(lane.target)]
    if not problems:
        return ()
    others = [name for name in lanes[0].inputs if name != OWN]
    if not others:
        return _chosen(problems, _terms((OWN,), ALONE))
    if len(others) > MOST_SCREENED:
        others = _screened(problems, others)
    tried = [term for name in others for term in (*_terms((name,), ALONE), *_terms((name, OWN), TOGETHER))]
    tried += [term for pair in combinations(sorted(others), 2) for term in _terms(pair, TOGETHER[-1:])]
    return _chosen(problems, tried)


def chosen_columns(choices: Iterable[Sequence[FormRows]]) -> int:
    """Which of several choices of own columns, the first being the simplest: its number.

    Each choice has the rows of every lane; they differ in their own columns only.
    """
    found: list[float] = []
    simplest: list[FormEvidence] = []
    for lanes in choices:
        problems = [lane.evidence() for lane in lanes if len(lane.target)]
        if not simplest:
            simplest = problems
            for lane in simplest:
                lane.settle(())
        for lane, first in zip(problems, simplest, strict=True):
            lane.share_noise(first)
        found.append(sum(lane.evidence() for lane in problems))
    best = int(np.argmax(found))
    return best if found[best] - found[0] >= LEAST_GAIN_NATS else 0


def _terms(inputs: tuple[str, ...], lengthscales: Sequence[float]) -> list[FormTerm]:
    return [FormTerm(inputs, scale, sd) for scale in lengthscales for sd in SD_DEG]


def _screened(lanes: Sequence[FormEvidence], names: Sequence[str]) -> list[str]:
    """Those of ``names`` that explain most in their smoothest form."""

    def gain(name: str) -> float:
        smooth = FormTerm((name, OWN), TOGETHER[-1], SD_DEG[-1])
        return sum(lane.gain(smooth) for lane in lanes)

    return sorted(names, key=gain, reverse=True)[:MOST_SCREENED]


def _chosen(lanes: Sequence[FormEvidence], candidates: Sequence[FormTerm]) -> tuple[FormTerm, ...]:
    chosen: list[FormTerm] = []
    left = list(candidates)
    while len(chosen) < MOST_TERMS and left:
        for lane in lanes:
            lane.settle(chosen)
        tried = [(sum(lane.gain(term) for lane in lanes), term) for term in left]
        best, term = max(tried, key=lambda pair: pair[0])
        if best < LEAST_GAIN_NATS:
            break
        chosen.append(term)
        inputs = {name for item in chosen for name in item.inputs if name != OWN}
        left = [item for item in left if set(item.inputs) != set(term.inputs)]
        left += [
            item
            for pair in combinations(sorted(inputs), 2)
            if not any(set(pair) == set(other.inputs) for other in chosen)
            for item in _terms(pair, TOGETHER)
            if item not in left
        ]
        if len(inputs) >= MOST_INPUTS:
            left = [item for item in left if set(item.inputs) - {OWN} <= inputs]
    return tuple(chosen)
