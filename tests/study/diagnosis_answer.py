"""What the diagnosis says about one glove, with the evidence it says it on."""

from __future__ import annotations

from typing import Any

from blind_glove import BlindGlove

from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits

NOTHING = "nothing"


def diagnosis_answer(glove: BlindGlove, limits: ImprovementLimits = IMPROVEMENT_LIMITS) -> dict[str, Any]:
    """First name ("nothing" for none), confidence set, ranking, and each effect's evidence.

    What is known by a signature in the recording comes before what is ranked by the error it saves.
    """
    found = diagnose(glove.takes, glove.layout, linear=glove.linear, limits=limits.diagnosis)
    signatures = list(dict.fromkeys(item.effect for item in found.signature))
    ranked = [*signatures, *(item.effect for item in found.naming.ranked)]
    return {
        "first": ranked[0] if ranked else NOTHING,
        "confidence_set": signatures[:1] or list(found.naming.confidence_set),
        "ranked": ranked,
        "right": names_of(glove),
        "rmse_deg": {name: round(value, 3) for name, value in found.rmse_deg.items()},
        "evidence": _evidence(found),
        "findings": sorted({f"{item.effect} {item.kind}" for item in found.findings}),
        "not_identifiable": {item.effect: item.why for item in found.not_identifiable},
        **glove.told(),
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


def _evidence(found: Diagnosis) -> dict[str, Any]:
    return {item.effect: _of_one(item) for item in found.assessments if _says_something(item)}


def _says_something(item: Assessment) -> bool:
    return bool(item.significant_joints) or any(abs(errors.saved) > 1e-6 for errors in item.errors)


def _of_one(item: Assessment) -> dict[str, Any]:
    """Shares of the squared error, joint by joint."""
    return {
        "significant_joints": [item.joints[place] for place in item.significant_joints],
        "saved": [round(errors.saved, 3) for errors in item.errors],
        "control_saved": [round(errors.control_saved, 3) for errors in item.errors],
        "contrast": [round(errors.contrast, 3) for errors in item.errors],
        "saved_square": round(item.saved_square, 4),
        "p_value": item.p_value,
    }
