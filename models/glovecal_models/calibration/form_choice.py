"""Which form an effect takes: the smooth functions of its inputs that the takes at hand ask for.

Forward selection by the marginal likelihood of the weights (Rasmussen and Williams 2006, section 5.4.1): it
pays for every function with the freedom that the function has. Errors of neighbouring times are alike, so
that many rows count for one (``ALIKE_ROWS``), as everywhere where weights are fitted.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from glovecal_models.calibration.held_out import ALIKE_ROWS, LEAST_VARIANCE_DEG2, Rows
from glovecal_models.effects.base.form_evidence import FormEvidence
from glovecal_models.effects.base.learned_form import MOST_INPUTS, OWN, FormTerm

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
