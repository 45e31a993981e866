"""From assessments to a name: the effect that explains most, and its confidence set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.effects.base.assessment import Assessment, over_joints


@dataclass(frozen=True)
class Naming:
    """The ranked causes; empty when nothing is to be named."""

    ranked: tuple[Assessment, ...]
    """Every significant effect, the one that saves most first."""
    confidence_set: tuple[str, ...]
    """The first, and all that these takes cannot tell from it."""


ALIKE_SHARE = 1e-4
"""Of the squared error: two columns that go together differ by rounding, however sure it is."""


def named(assessments: Sequence[Assessment], limits: DiagnosisLimits = DIAGNOSIS_LIMITS) -> Naming:
    """Rank the effects that beat their control significantly."""
    passing = sorted(
        (item for item in assessments if item.significant_joints), key=lambda item: -item.saved_square
    )
    if not passing:
        return Naming((), ())
    best = passing[0]
    worse_se = limits.rival_worse_se
    rivals = [item.effect for item in passing[1:] if not _is_significantly_worse(item, best, worse_se)]
    return Naming(tuple(passing), (best.effect, *rivals))


def _is_significantly_worse(item: Assessment, best: Assessment, standard_errors: float) -> bool:
    """Whether ``item`` leaves significantly more error than ``best`` on the significant joints of either.

    Effects that change from take to take are compared take by take: blocks of one take are not independent.
    """
    joints = sorted({*best.significant_joints, *item.significant_joints})
    worse = [
        (item.errors[j].added - best.errors[j].added) / (best.errors[j].base.sum() or 1.0) for j in joints
    ]
    takes = [best.errors[j].take for j in joints]
    by_take = item.p_value is not None and best.p_value is not None
    worse = over_joints(worse, takes, by_take=by_take)
    if len(worse) < 2 or worse.sum() <= ALIKE_SHARE:
        return False
    return bool(worse.mean() > standard_errors * worse.std(ddof=1) / np.sqrt(len(worse)))
