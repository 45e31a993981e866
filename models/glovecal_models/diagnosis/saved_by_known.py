"""What the effects of a model save of the error: the scale that a second effect is held against.

A named effect is right in its inputs and only nearly right in its form. What the form misses goes along with
the same movements, so that another effect can grasp a part of it; a cause of its own saves more.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.problem import DiagnosisProblem
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.signature_effect import Finding


def saved_by_known(problem: DiagnosisProblem, design: ForwardDesign) -> dict[str, float]:
    """Squared degrees per row, held out, for each joint of ``design``, which is that of ``problem``; empty
    without known effects."""
    if not problem.known:
        return {}
    without = _mean_square(replace(problem, known=()).design())
    return {name: max(without[name] - left, 0.0) for name, left in _mean_square(design).items()}


def beside_known(found: Sequence[Assessment], saved: Mapping[str, float]) -> list[Assessment]:
    """The same, held against what the known effects save."""
    if not saved:
        return list(found)
    return [replace(item, known_saved_square=tuple(saved[name] for name in item.joints)) for item in found]


def is_beside_known(finding: Finding, saved: Mapping[str, float], share: float) -> bool:
    """Whether a finding of a size is larger than what the known effects may have left on its rotations."""
    if finding.size_deg is None:
        return True
    least = max((saved.get(name, 0.0) for name in finding.where), default=0.0)
    return finding.size_deg**2 >= share * least


def _mean_square(design: ForwardDesign) -> dict[str, float]:
    return {
        name: float(item.error.sum() / max(item.count.sum(), 1))
        for name, item in zip(design.rotations, design.products, strict=True)
    }
