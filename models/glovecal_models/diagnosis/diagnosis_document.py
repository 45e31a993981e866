"""A diagnosis in words and as plain data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from glovecal_models.diagnosis.hold_drift_document import hold_document, hold_named, hold_sentence
from glovecal_models.diagnosis.not_identifiable import NotJudgeable
from glovecal_models.diagnosis.pose_labels import UNITS
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.signature_effect import Finding

if TYPE_CHECKING:
    from glovecal_models.diagnosis.diagnosis import Diagnosis


def document(diagnosis: Diagnosis) -> dict[str, Any]:
    """JSON-able; every error in degrees, on takes left out, with readings and reference smoothed alike."""
    named = diagnosis.naming.ranked[0] if diagnosis.naming.ranked else None
    signature = diagnosis.signature
    return {
        "rotations": {
            name: {"rmse_deg": value, "noise_floor_deg": diagnosis.noise_floor_deg.get(name)}
            for name, value in diagnosis.rmse_deg.items()
        },
        "named": _signature(diagnosis, signature) if signature else _named_or_held(diagnosis, named),
        "candidates": [_candidate(item) for item in diagnosis.by_gain],
        "not_judgeable": [{"effect": item.effect, "why": item.why} for item in diagnosis.not_judgeable],
        "findings": [
            {
                "effect": item.effect,
                "kind": item.kind,
                "where": list(item.where),
                "sentence": item.sentence,
                "stretches": [
                    {"take": part.take, "start_s": part.start_s, "end_s": part.end_s}
                    for part in item.stretches
                ],
            }
            for item in diagnosis.findings
        ],
        "reference_problems": list(diagnosis.reference_problems),
        "hold_drift": None if diagnosis.hold_drift is None else hold_document(diagnosis.hold_drift),
        "something_left": {
            "is_left": diagnosis.left.is_left,
            "sentence": diagnosis.left.sentence,
            "not_judgeable": diagnosis.left.not_judgeable,
            "goes_with": [asdict(item) for item in diagnosis.left.goes_with],
        },
        "next_take": None
        if diagnosis.next_take is None
        else {
            "what": diagnosis.next_take.what,
            "seconds": diagnosis.next_take.seconds,
            "separates": list(diagnosis.next_take.separates),
        },
        "sentences": sentences(diagnosis),
    }


def sentences(diagnosis: Diagnosis) -> list[str]:
    """What a mocap engineer should know, the most important first."""
    told = list(diagnosis.reference_problems)
    told += [item.sentence for item in diagnosis.findings]
    if diagnosis.naming.ranked:
        told.append(named_sentence(diagnosis))
    elif diagnosis.hold_drift is not None:
        told += [hold_sentence(diagnosis.hold_drift), UNITS]
    elif not diagnosis.findings:
        told.append(nothing_named_sentence(diagnosis))
    if diagnosis.next_take is not None:
        rivals = " and ".join(diagnosis.next_take.separates)
        told.append(
            f"To tell {rivals} apart record {diagnosis.next_take.seconds} s: {diagnosis.next_take.what}"
        )
    told.append(diagnosis.left.sentence)
    return told + not_judgeable_sentences(diagnosis.not_judgeable)


def not_judgeable_sentences(items: Sequence[NotJudgeable]) -> list[str]:
    """One for each reason."""
    reasons: dict[str, list[str]] = {}
    for item in items:
        reasons.setdefault(item.why, []).append(item.effect)
    return [f"{', '.join(effects)} cannot be judged: {why}." for why, effects in reasons.items()]


def nothing_named_sentence(diagnosis: Diagnosis) -> str:
    """Because nothing beats its decoy, or because too little was recorded to tell."""
    blocks = max((len(e.base) for item in diagnosis.assessments for e in item.errors), default=0)
    fewest = diagnosis.limits.fewest_blocks
    if blocks < fewest:
        needed = f"{blocks} pieces of 5 s, {fewest} are needed"
        return f"Too little was recorded to judge any effect: {needed}."
    return "No known effect explains more of the error than its decoy does."


def named_sentence(diagnosis: Diagnosis) -> str:
    """The first of the ranking, with its evidence, and whom it cannot be told from."""
    item = diagnosis.naming.ranked[0]
    before, after, decoy = errors_deg(item)
    where = ", ".join(item.joints[i] for i in item.touched)
    start = (
        f"{item.effect} on {where}: it takes the error from {before:.2f} to {after:.2f} degrees on takes left"
        f" out (its decoy to {decoy:.2f})"
    )
    rivals = diagnosis.naming.confidence_set[1:]
    if rivals:
        return f"{start}; these takes cannot tell it from {', '.join(rivals)}."
    caveat = diagnosis.effects[item.effect].caveat
    return f"{start}, {caveat}." if caveat else f"{start}."


def errors_deg(item: Assessment) -> tuple[float, float, float]:
    """RMSE over the touched joints (all, if none) without the effect, with it, with its decoy."""
    joints = item.touched or tuple(range(len(item.errors)))
    rows = sum(item.errors[i].rows for i in joints)
    parts = [[getattr(item.errors[i], name).sum() for i in joints] for name in ("base", "added", "decoy")]
    before, after, decoy = (float(np.sqrt(max(sum(part), 0.0) / max(rows, 1))) for part in parts)
    return before, after, decoy


def _named_or_held(diagnosis: Diagnosis, first: Assessment | None) -> dict[str, Any] | None:
    if first is not None:
        return _named(diagnosis, first)
    return None if diagnosis.hold_drift is None else hold_named(diagnosis.hold_drift)


def _named(diagnosis: Diagnosis, item: Assessment) -> dict[str, Any]:
    before, after, decoy = errors_deg(item)
    return {
        "effect": item.effect,
        "where": [item.joints[i] for i in item.touched],
        "kind": diagnosis.effects[item.effect].kind,
        "verdict": "named" if len(diagnosis.naming.confidence_set) < 2 else "ambiguous",
        "confidence_set": list(diagnosis.naming.confidence_set),
        "parameters": {item.joints[i]: item.shape_described(i) for i in item.touched},
        "saved_deg": before - after,
        "decoy_saved_deg": before - decoy,
        "sentence": named_sentence(diagnosis),
    }


def _signature(diagnosis: Diagnosis, findings: Sequence[Finding]) -> dict[str, Any]:
    first, rivals = findings[0], diagnosis.naming.confidence_set
    rivals = rivals if first.effect in rivals else (first.effect,)
    return {
        "effect": first.effect,
        "where": sorted({name for item in findings for name in item.where}),
        "kind": diagnosis.effects[first.effect].kind,
        "verdict": "named" if len(rivals) < 2 else "ambiguous",
        "confidence_set": list(rivals),
        "parameters": dict(first.evidence),
        "saved_deg": None,
        "decoy_saved_deg": None,
        "sentence": first.sentence,
    }


def _candidate(item: Assessment) -> dict[str, Any]:
    before, after, decoy = errors_deg(item)
    worst = max(range(len(item.errors)), key=lambda i: item.errors[i].contrast)
    return {
        "effect": item.effect,
        "where": [item.joints[i] for i in item.touched],
        "rmse_before_deg": before,
        "rmse_after_deg": after,
        "rmse_decoy_deg": decoy,
        "saved_share": {name: e.saved for name, e in zip(item.joints, item.errors, strict=True)},
        "decoy_saved_share": {name: e.decoy_saved for name, e in zip(item.joints, item.errors, strict=True)},
        "probability": item.probability,
        "passes": bool(item.touched),
        "sentence": (
            f"{item.effect}: {before:.2f} to {after:.2f} degrees (decoy {decoy:.2f});"
            f" most on {item.joints[worst]}."
        ),
    }
