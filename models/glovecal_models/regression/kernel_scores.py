"""What was found of each candidate kernel, which of them is taken, and the sentence that says so.

A trained process keeps the choice as part of its evidence; it is checked when it is read.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from glovecal_models.errors import DamagedArtifact
from glovecal_models.regression.kernel_candidates import CANDIDATE, CANDIDATES
from glovecal_models.regression.regressor import ProcessRegressor, Regressor, stored_number

CLEAR_NATS = 5.0
"""Evidence that leaves little doubt: odds of 150 to 1 (Kass & Raftery 1995: "very strong")."""
CLEAR_SHARE = 0.05
"""Of the held-out error; less than what the choice of takes moves it by."""
CLEAR_TAKES = 0.8
"""Share of the takes left out on which another kernel must err less: one odd take decides nothing."""
FEWEST_TAKES = 3
LOST = 0.5
"""An error of more than this part of the angle's spread is guessing: no kernel is judged by it."""


@dataclass(frozen=True)
class CandidateScore:
    name: str
    nlml: float
    """Negative log marginal likelihood of the tried samples, nats, densities per degree."""
    parameters: int
    """Numbers that the likelihood was maximised over."""
    held_out_rmse_deg: float | None = None
    """None where it was not measured."""
    rmse_by_take_deg: tuple[float, ...] = ()
    """Of each take left out; of an only take, of its stretches of each fold."""


@dataclass(frozen=True)
class KernelScores:
    """Of the same samples; the first is the default, which stays unless another is clearly better."""

    scores: tuple[CandidateScore, ...]
    samples: int
    sample_weight: float
    straight_line_deg: float | None
    """Held-out error of a plane through the same samples; None without a fold to leave out."""
    spread_deg: float | None
    """Standard deviation of the measured angle: the error of always saying its mean."""

    @property
    def default(self) -> CandidateScore:
        return self.scores[0]

    @property
    def chosen(self) -> CandidateScore:
        """The least error of those clearly better than the default; of about equal ones the simplest."""
        clear = [item for item in self.scores[1:] if self._is_clearly_better(item)]
        if not clear:
            return self.default
        least = min(_rmse(item) for item in clear)
        return next(item for item in clear if (1 - CLEAR_SHARE) * _rmse(item) <= least)

    def log_evidence(self, score: CandidateScore) -> float:
        """Nats: the best likelihood less what fitting its parameters is worth (Schwarz 1978)."""
        return -score.nlml - 0.5 * score.parameters * float(np.log(max(self.sample_weight * self.samples, 2)))

    def evidence_gain(self, score: CandidateScore) -> float:
        """Nats over the default."""
        return self.log_evidence(score) - self.log_evidence(self.default)

    def has_clear_evidence(self, score: CandidateScore) -> bool:
        return self.evidence_gain(score) > CLEAR_NATS

    def _is_clearly_better(self, score: CandidateScore) -> bool:
        mine, default = np.array(score.rmse_by_take_deg), np.array(self.default.rmse_by_take_deg)
        if len(mine) < FEWEST_TAKES or self.spread_deg is None or not self.has_clear_evidence(score):
            return False
        return (
            _rmse(score) < (1 - CLEAR_SHARE) * _rmse(self.default)
            and _rmse(score) < LOST * self.spread_deg
            and float(np.mean(mine < default)) >= CLEAR_TAKES
        )

    def sentence(self, rotation: str) -> str:
        """What a user should know of the choice for ``rotation``."""
        chosen, default = self.chosen, self.default
        stays = CANDIDATE[default.name].words
        if chosen.held_out_rmse_deg is None:
            return f"{rotation}: {stays} stays; these takes leave nothing to judge other kernels on."
        error = f"{chosen.held_out_rmse_deg:.2f} degrees on takes left out"
        line = "" if self.straight_line_deg is None else f" (a straight line: {self.straight_line_deg:.2f})"
        if chosen is default:
            why = "no other kernel is clearly better in both evidence and error"
            if self.spread_deg and min(map(_rmse, self.scores)) > LOST * self.spread_deg:
                why = "no kernel foretells these takes, so none is chosen by them; record more that are alike"
            return f"{rotation}: {stays} stays, {error}{line}; {why}."
        return (
            f"{rotation}: {CANDIDATE[chosen.name].words} fits best: {error} against "
            f"{default.held_out_rmse_deg:.2f} for {stays}{line}; its evidence is "
            f"{self.evidence_gain(chosen):.0f} nats better on the same {self.samples} samples."
        )

    def to_document(self) -> dict[str, Any]:
        """JSON-able; ``chosen`` is told beside what it follows from."""
        return {**asdict(self), "chosen": self.chosen.name}

    @classmethod
    def from_document(cls, document: Any) -> KernelScores:
        """Inverse of ``to_document``. Raises DamagedArtifact."""
        if not isinstance(document, Mapping) or not isinstance(document.get("scores"), Sequence):
            raise DamagedArtifact(f"kernel_choice is {document!r}, expected an object with scores")
        scores = cls(
            scores=tuple(_restored(item) for item in document["scores"]),
            samples=int(stored_number(document, "samples", 1)),
            sample_weight=stored_number(document, "sample_weight", 0.0),
            straight_line_deg=_number_or_none(document, "straight_line_deg"),
            spread_deg=_number_or_none(document, "spread_deg"),
        )
        if not scores.scores:
            raise DamagedArtifact("kernel_choice has no scores")
        if scores.chosen.name != document.get("chosen"):
            raise DamagedArtifact(
                f"kernel_choice says {document.get('chosen')!r}, its scores say {scores.chosen.name!r}"
            )
        return scores


def kernel_sentences(choices: Mapping[str, KernelScores]) -> list[str]:
    """One for each rotation whose kernel is not the default, and one for all the others."""
    moved = {name: item for name, item in choices.items() if item.chosen is not item.default}
    said = [item.sentence(name) for name, item in moved.items()]
    rest = [name for name in choices if name not in moved]
    if len(rest) == 1:
        said.append(choices[rest[0]].sentence(rest[0]))
    elif rest:
        stays = CANDIDATE[choices[rest[0]].default.name].words
        said.append(
            f"{stays} stays for {', '.join(rest)}: no other kernel is clearly better there in both evidence "
            f"(by {CLEAR_NATS:.0f} nats) and error on takes left out (by {100 * CLEAR_SHARE:.0f} %)."
        )
    return said


def _restored(item: Any) -> CandidateScore:
    if not isinstance(item, Mapping) or item.get("name") not in CANDIDATE:
        raise DamagedArtifact(f"kernel_choice: score {item!r} is of none of {', '.join(CANDIDATE)}")
    by_take = item.get("rmse_by_take_deg")
    if not isinstance(by_take, Sequence) or isinstance(by_take, str):
        raise DamagedArtifact(f"kernel_choice: rmse_by_take_deg is {by_take!r}, expected a list of numbers")
    return CandidateScore(
        name=str(item["name"]),
        nlml=stored_number(item, "nlml", -np.inf),
        parameters=int(stored_number(item, "parameters", 0)),
        held_out_rmse_deg=_number_or_none(item, "held_out_rmse_deg"),
        rmse_by_take_deg=tuple(
            stored_number({"error of a take": value}, "error of a take", 0.0) for value in by_take
        ),
    )


def _number_or_none(document: Mapping[str, Any], name: str) -> float | None:
    return None if document.get(name) is None else stored_number(document, name, 0.0)


def _rmse(item: CandidateScore) -> float:
    return np.inf if item.held_out_rmse_deg is None else item.held_out_rmse_deg


KEY = "kernel_choice"


def with_choice(regressor: ProcessRegressor, scores: KernelScores) -> ProcessRegressor:
    return replace(regressor, evidence=regressor.evidence | {KEY: scores.to_document()})


def choice_of(regressor: Regressor) -> KernelScores | None:
    """None when nothing was chosen. Raises DamagedArtifact where the choice is not of this process."""
    if not isinstance(regressor, ProcessRegressor) or KEY not in regressor.evidence:
        return None
    scores = KernelScores.from_document(regressor.evidence[KEY])
    chosen = CANDIDATE[scores.chosen.name]
    if chosen.covariance.settings() != regressor.covariance.settings():
        raise DamagedArtifact(
            f"kernel_choice says {chosen.name!r}, but the process has covariance {regressor.covariance!r}"
        )
    return scores


def kernel_of(regressor: Regressor) -> str | None:
    """The candidate's name; None for what no candidate trains (linear, SPGP, a rule)."""
    if not isinstance(regressor, ProcessRegressor):
        return None
    kind = regressor.covariance.settings()
    found = (c.name for c in CANDIDATES if (c.method, c.covariance.settings()) == (regressor.method, kind))
    return next(found, None)


def keeping_choice(before: Regressor, after: Regressor) -> Regressor:
    """``after``, trained anew with the kernel of ``before``, and how that kernel was chosen."""
    scores = choice_of(before)
    if scores is None or not isinstance(after, ProcessRegressor) or kernel_of(after) != kernel_of(before):
        return after
    return with_choice(after, scores)
