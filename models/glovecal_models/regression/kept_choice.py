"""The choice of a kernel as a trained process keeps it: part of its evidence, checked when it is read."""

from __future__ import annotations

from dataclasses import replace

from glovecal_models.errors import DamagedArtifact
from glovecal_models.regression.kernel_candidates import CANDIDATE, CANDIDATES
from glovecal_models.regression.kernel_scores import KernelScores
from glovecal_models.regression.process_regressor import ProcessRegressor
from glovecal_models.regression.regressor import Regressor

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
