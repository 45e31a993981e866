"""From assessments to a name: the effect that explains most, and its confidence set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.effects.base.assessment import Assessment, over_joints
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.limits import SignificanceLimits
from glovecal_models.effects.base.signature_effect import Finding


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


def beside_known(
    found: Sequence[Assessment],
    saved: Mapping[str, float],
    known: Sequence[Effect],
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS,
) -> list[Assessment]:
    """The same, held against what the effects of the model save on each joint, degrees squared per row.

    A named effect is right in its inputs and only nearly right in its form. What the form misses goes along
    with the same movements, so that another effect can grasp a part of it; a cause of its own saves more.
    Of what their forms leave an effect that it hardly looks like grasps less: it may save less.
    """
    if not saved:
        return list(found)
    unlike = set.intersection(*(set(item.rest_unlike) for item in known)) if known else set()
    alike = {name for item in known for name in item.rest_like}
    strict = replace(limits, beside_known_share=limits.beside_alike_share)
    mild = replace(limits, beside_known_share=limits.beside_unlike_share)

    def limits_of(item: Assessment) -> SignificanceLimits:
        if item.effect in unlike:
            return mild
        return strict if item.effect in alike else item.limits

    return [
        replace(item, known_saved_square=tuple(saved[name] for name in item.joints), limits=limits_of(item))
        for item in found
    ]


def beside_wholes(found: Sequence[Assessment], known: Sequence[Effect]) -> list[Assessment]:
    """The same, where the model has an effect that others seem to explain a part of, such as a slip: they
    have to explain more than that."""
    wholes = {name: item for item in known for name in item.also_explained_by}
    result = []
    for item in found:
        whole = wholes.get(item.effect)
        if (
            whole is not None
            and item.significant_joints
            and item.steps is None
            and saved_share_of(item) < whole.also_explained_share
        ):
            item = replace(item, part_of=whole.name)
        result.append(item)
    return result


def saved_share_of(found: Assessment) -> float:
    """Share of the squared error that an effect saves on its significant joints, all together."""
    errors = [found.errors[joint] for joint in found.significant_joints]
    before, after = (sum(float(getattr(item, part).sum()) for item in errors) for part in ("base", "added"))
    return 1.0 - after / before if before > 0 else 0.0


def is_beside_known(finding: Finding, saved: Mapping[str, float], share: float) -> bool:
    """Whether a finding of a size is larger than what those effects may have left on its rotations."""
    if finding.size_deg is None:
        return True
    least = max((saved.get(name, 0.0) for name in finding.where), default=0.0)
    return finding.size_deg**2 >= share * least


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
