"""Which form an effect takes: the smooth functions of its inputs that the takes at hand ask for.

Forward selection by the marginal likelihood of the weights (Rasmussen and Williams 2006, section 5.4.1): it
pays for every function with the freedom that the function has. Errors of neighbouring times are alike, so
that many rows count for one (``ALIKE_ROWS``), as everywhere where weights are fitted.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from glovecal_models.calibration.held_out import ALIKE_ROWS, LEAST_VARIANCE_DEG2, Rows
from glovecal_models.effects.base.learned_form import (
    MOST_INPUTS,
    MOST_SINES,
    OWN,
    FormTerm,
    LearnedForm,
    sines,
)

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
Key = tuple[tuple[str, ...], float] | None
"""Inputs and lengthscale of a term; None: the effect's own columns."""


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


def chosen_form(lanes: Sequence[FormRows]) -> tuple[FormTerm, ...]:
    """The terms that the lanes of one effect share, at most three inputs; empty: its own columns are enough.

    Every lane has the same inputs, in units of its own range.
    """
    problems = [_Lane(lane) for lane in lanes if len(lane.target)]
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
    simplest: list[_Lane] = []
    for lanes in choices:
        problems = [_Lane(lane) for lane in lanes if len(lane.target)]
        if not simplest:
            simplest = problems
            for lane in simplest:
                lane.settle(())
        for lane, first in zip(problems, simplest, strict=True):
            lane.share_noise(first)
        found.append(sum(lane.evidence(()) for lane in problems))
    best = int(np.argmax(found))
    return best if found[best] - found[0] >= LEAST_GAIN_NATS else 0


def _terms(inputs: tuple[str, ...], lengthscales: Sequence[float]) -> list[FormTerm]:
    return [FormTerm(inputs, scale, sd) for scale in lengthscales for sd in SD_DEG]


def _screened(lanes: Sequence[_Lane], names: Sequence[str]) -> list[str]:
    """Those of ``names`` that explain most in their smoothest form."""

    def gain(name: str) -> float:
        smooth = FormTerm((name, OWN), TOGETHER[-1], SD_DEG[-1])
        return sum(lane.evidence([smooth]) for lane in lanes)

    return sorted(names, key=gain, reverse=True)[:MOST_SCREENED]


def _chosen(lanes: Sequence[_Lane], candidates: Sequence[FormTerm]) -> tuple[FormTerm, ...]:
    chosen: list[FormTerm] = []
    left = list(candidates)
    while len(chosen) < MOST_TERMS and left:
        for lane in lanes:
            lane.settle(chosen)
        now = sum(lane.evidence(chosen) for lane in lanes)
        tried = [(sum(lane.evidence([*chosen, term]) for lane in lanes), term) for term in left]
        best, term = max(tried, key=lambda pair: pair[0])
        if best - now < LEAST_GAIN_NATS:
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


class _Lane:
    """Sums of products of one lane, the base's free columns projected out."""

    def __init__(self, rows: FormRows) -> None:
        self._free = np.linalg.qr(rows.free)[0]
        ranges = LearnedForm.over([FormTerm((name,), 1.0, 1.0) for name in rows.inputs], [rows.inputs])
        self._place = {name: ranges.place(name, values)[:, 0] for name, values in rows.inputs.items()}
        self._sines: dict[str, np.ndarray] = {}
        self._target = self._without_base(rows.target)
        self._plain = self._without_base((rows.plain * rows.plain_sd).T)
        self._columns: dict[Key, np.ndarray] = {None: self._plain}
        self._gram: dict[tuple[Key, Key], np.ndarray] = {}
        self._right: dict[Key, np.ndarray] = {}
        self._variance = max(float(self._target @ self._target) / len(self._target), LEAST_VARIANCE_DEG2)

    def settle(self, terms: Sequence[FormTerm]) -> None:
        """Take what ``terms`` leave as the noise from now on."""
        for _ in range(2):
            gram, right = self._parts(terms)
            noise = self._noise
            weights = np.linalg.solve(gram + noise * np.eye(len(gram)), right)
            square = self._target @ self._target - 2 * weights @ right + weights @ gram @ weights
            self._variance = max(float(square) / len(self._target), LEAST_VARIANCE_DEG2)

    def share_noise(self, other: _Lane) -> None:
        self._variance = other._variance

    def evidence(self, terms: Sequence[FormTerm]) -> float:
        """The log marginal likelihood, nats, up to what all choices share."""
        gram, right = self._parts(terms)
        noise = self._noise
        inner = np.eye(len(gram)) + gram / noise
        factor = cho_factor(inner, lower=True, check_finite=False)
        quadratic = float(right @ cho_solve(factor, right, check_finite=False)) / noise**2
        return 0.5 * quadratic - float(np.log(np.diagonal(factor[0])).sum())

    @property
    def _noise(self) -> float:
        return ALIKE_ROWS / EVERY * self._variance

    def _parts(self, terms: Sequence[FormTerm]) -> tuple[np.ndarray, np.ndarray]:
        """Gram matrix and right side of own columns and ``terms``, for weights expected of size 1."""
        keys: list[Key] = [None, *((term.inputs, term.lengthscale) for term in terms)]
        scale = np.concatenate([np.ones(len(self._plain)), *(np.full(t.count, t.sd_deg) for t in terms)])
        ends = np.cumsum([len(self._plain), *(term.count for term in terms)]).tolist()
        places = [slice(start, end) for start, end in pairwise([0, *ends])]
        gram = np.empty((len(scale), len(scale)))
        for one, rows in zip(keys, places, strict=True):
            for other, columns in zip(keys, places, strict=True):
                gram[rows, columns] = self._product(one, other)
        right = np.concatenate([self._with_target(key) for key in keys])
        return gram * scale[:, None] * scale[None, :], right * scale

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
            assert key is not None
            inputs, lengthscale = key
            columns = FormTerm(inputs, lengthscale, 1.0).of_sines([self._sines_of(name) for name in inputs])
            self._columns[key] = self._without_base(columns)
        return self._columns[key]

    def _sines_of(self, name: str) -> np.ndarray:
        """(``MOST_SINES``, N) of an input, for terms of every lengthscale."""
        if name not in self._sines:
            self._sines[name] = sines(self._place[name], MOST_SINES)
        return self._sines[name]

    def _without_base(self, columns: np.ndarray) -> np.ndarray:
        """``columns`` (..., N)."""
        return columns - (columns @ self._free) @ self._free.T
