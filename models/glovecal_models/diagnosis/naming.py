"""From assessments to a name: the effect that explains most, and its confidence set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.effects.base.assessment import Assessment, over_joints
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.findings import Finding
from glovecal_models.effects.base.relations import Whole
from glovecal_models.effects.catalogue import relations


@dataclass(frozen=True)
class Naming:
    """The ranked causes; empty when nothing is to be named."""

    ranked: tuple[Assessment, ...] = ()
    """Every significant effect, the one that saves most first."""
    confidence_set: tuple[str, ...] = ()
    """The first, and all that these takes cannot tell from it."""

    @property
    def first(self) -> Assessment | None:
        """The one that saves most; None when nothing is ranked."""
        return self.ranked[0] if self.ranked else None

    def also(self, names: Sequence[str]) -> Naming:
        """The same with further members of the confidence set."""
        return replace(self, confidence_set=tuple(dict.fromkeys((*self.confidence_set, *names))))


ROUNDING_SHARE = 1e-4
"""Of the squared error: two columns that go together differ by rounding, however sure it is."""


def named(assessments: Sequence[Assessment], limits: DiagnosisLimits = DIAGNOSIS_LIMITS) -> Naming:
    """Rank the effects that beat their control significantly."""
    passing = sorted(
        (item for item in assessments if item.significant_joints), key=lambda item: -item.saved_square
    )
    if not passing:
        return Naming()
    best = passing[0]
    worse_se = limits.rival_worse_se
    rivals = [item.effect for item in passing[1:] if not _is_significantly_worse(item, best, worse_se)]
    return Naming(tuple(passing), (best.effect, *rivals))


def with_known_saved(found: Sequence[Assessment], saved: Mapping[str, float]) -> list[Assessment]:
    """The same, held against what the effects of the model save on each joint, degrees squared per row."""
    if not saved:
        return list(found)
    return [replace(item, known_saved_square=tuple(saved[name] for name in item.joints)) for item in found]


def with_other_share(
    found: Sequence[Assessment], known: Sequence[Effect], limits: DiagnosisLimits, *, mimics: bool
) -> list[Assessment]:
    """The same, where those that what the forms of the ``known`` effects leave looks like have to save more,
    or (not ``mimics``) those that it hardly looks like may save less."""
    if not known:
        return list(found)
    remainders = [relations().remainder(item.name) for item in known]
    unlike = set.intersection(*(set(item.unlike) for item in remainders))
    alike = {name for item in remainders for name in item.like} - unlike
    share = limits.beside_alike_share if mimics else limits.beside_unlike_share
    chosen, other = alike if mimics else unlike, replace(limits, beside_known_share=share)
    return [replace(item, limits=other) if item.effect in chosen else item for item in found]


def parts_of(found: Sequence[Assessment], known: Sequence[Whole]) -> list[Assessment]:
    """The same, where the model has an effect that others seem to explain a part of, such as a slip: they
    have to explain more than that."""
    wholes = {name: item for item in known for name in item.parts}
    result = []
    for item in found:
        whole = wholes.get(item.effect)
        if (
            whole is not None
            and item.significant_joints
            and item.steps is None
            and saved_share_of(item) < whole.share
        ):
            item = replace(item, part_of=whole.effect)
        result.append(item)
    return result


def also_found(naming: Naming, findings: Sequence[Finding], sensor_of: Mapping[str, str]) -> Naming:
    """The same with findings that may be one of the ranked effects instead, where that saves error on the
    same rotations; ``sensor_of``: the sensor of each rotation."""
    found = []
    for item in findings:
        rotations = {
            ranked.joints[i]
            for ranked in naming.ranked
            if ranked.effect in item.rivals and ranked.effect in naming.confidence_set
            for i in ranked.significant_joints
        }
        places = rotations.union(sensor_of[name] for name in rotations if name in sensor_of)
        if not places.isdisjoint(item.where):
            found.append(item.effect)
    return naming.also(found)


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
    if len(worse) < 2 or worse.sum() <= ROUNDING_SHARE:
        return False
    return bool(worse.mean() > standard_errors * worse.std(ddof=1) / np.sqrt(len(worse)))
