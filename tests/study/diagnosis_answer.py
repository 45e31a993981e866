"""What the diagnosis says about one glove."""

from __future__ import annotations

from typing import Any

from blind_glove import BlindGlove

from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits

NOTHING = "nothing"


def diagnosis_answer(glove: BlindGlove, limits: ImprovementLimits = IMPROVEMENT_LIMITS) -> dict[str, Any]:
    """First name ("nothing" for none), confidence set and ranking.

    What is known by a signature in the recording comes before what is ranked by the error it saves.
    """
    found = diagnose(glove.takes, glove.layout, linear=glove.linear, limits=limits.diagnosis)
    return verdict(found) | {"right": names_of(glove), **glove.told()}


def told_answer(glove: BlindGlove, limits: ImprovementLimits = IMPROVEMENT_LIMITS) -> dict[str, Any]:
    """The same with what else a person is told of sensors, the reference and the residual."""
    found = diagnose(glove.takes, glove.layout, linear=glove.linear, limits=limits.diagnosis)
    return verdict(found) | {
        "right": names_of(glove),
        "findings": [item.sentence for item in found.findings],
        "reference_problems": list(found.reference_problems),
        "unexplained_residual": found.residual.is_significant,
        **glove.told(),
    }


def verdict(found: Diagnosis) -> dict[str, Any]:
    """First name, confidence set and ranking of one diagnosis."""
    signatures = list(dict.fromkeys(item.effect for item in found.signature))
    ranked = [*signatures, *(item.effect for item in found.naming.ranked)]
    if not ranked and found.by_column:
        ranked = [item.effect for item in found.by_column[:1]]
    return {
        "first": ranked[0] if ranked else NOTHING,
        "confidence_set": [] if found.named is None else list(found.named.confidence_set),
        "ranked": ranked,
    }


def names_of(glove: BlindGlove) -> list[str]:
    """Names that are true of a glove: its causes', and the column's of a recorded unknown cause.

    Every glove's curve is a little bent, so that beside a straight line "nonlinearity" is true of all.
    """
    names = [cause.name for cause in glove.causes if not cause.name.startswith("unknown:")]
    if glove.column and any(cause.name.startswith("unknown:") for cause in glove.causes):
        names.append(f"context:{glove.column}")
    if glove.linear and "nonlinearity" not in names:
        names.append("nonlinearity")
    return names
