"""A walk of the loop as a page, made from its document alone: the fall of the error, step by step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from glovecal_service.report.error_fall import Fall, FloorBand, error_fall
from glovecal_service.report.hold_table import hold_table
from glovecal_service.report.html import figure, listed, table, whole_page

STOPPED = {
    "noise_floor": "It stopped at the noise floor.",
    "nothing_named": "It stopped because no known effect saves more than its decoy and chance do.",
    "ambiguous": "It stopped because these takes cannot tell the causes apart.",
    "not_better": "It stopped because the next effect did not pay on takes left out and was undone.",
}


def improvement_page(found: Mapping[str, Any], method: str, subject: str) -> str:
    """HTML. Keys that an improvement of another version lacks are left out."""
    steps = found["steps"]
    picture, sentence = error_fall(falls_of(found, method), band_of(found))
    parts = [
        f"<h1>How the error of {escape(subject)}'s calibration fell</h1>",
        figure(picture, sentence),
        f"<p>{escape(STOPPED.get(found['stopped'], ''))}</p>",
        "<h2>Each rotation</h2>",
        _rotations(steps, found.get("noise_floor_deg") or {}, method),
        "<h2>Each step</h2>",
        table(
            ("model", "added", "where", "verdict", "RMSE, degrees"), [_row(step, method) for step in steps]
        ),
    ]
    following = found.get("next_take")
    if following:
        rivals = " and ".join(following.get("separates") or ())
        text = f"To tell {rivals} apart record {following['seconds']} s: {following['what']}"
        parts.append(f'<p class="note">{escape(text)}</p>')
    held = found.get("hold_drift")
    if held and held["poses"]:
        parts += ["<h2>What readings do while a pose is held</h2>", hold_table(held)]
    if found.get("sentences"):
        parts += ["<h2>What was found on the way</h2>", listed(found["sentences"])]
    return whole_page(f"improvement of {subject}", parts)


def falls_of(found: Mapping[str, Any], method: str) -> list[Fall]:
    """Simpler calibrations, the base, and a bar for each effect."""
    scale = sorted((found.get("baselines") or {}).items(), key=lambda item: -item[1])
    falls = [Fall(name, error, is_scale=True) for name, error in scale]
    before: Mapping[str, Any] | None = None
    for step in found["steps"]:
        added = step["added"]
        label = method if added is None else "+ " + added["effect"].replace("_", "\n", 1)
        falls.append(Fall(label, step["rmse_deg"], None if before is None else _with_decoy(before, step)))
        before = step
    return falls


def band_of(found: Mapping[str, Any]) -> FloorBand | None:
    """The noise floor over all rotations that the last step measured; None when that of one is unknown."""
    floors = found.get("noise_floor_deg") or {}
    spans = found.get("noise_floor_interval_deg") or {}
    names = found["steps"][-1]["per_rotation"]
    if any(floors.get(name) is None for name in names):
        return None
    return FloorBand.of({name: (floors[name], *spans.get(name, [floors[name]] * 2)) for name in names})


def _with_decoy(before: Mapping[str, Any], step: Mapping[str, Any]) -> float | None:
    """Over all rotations, in degrees: those the effect touches with its decoy, the others as they were.

    Not above the error before: what made it worse would have been undone.
    """
    decoy, added = step.get("decoy_rmse_deg"), step["added"]
    if decoy is None or not added or not before["rmse_deg"]:
        return None
    share = decoy / before["rmse_deg"]
    squares = [
        (share * error) ** 2 if name in added["where"] else error**2
        for name, error in before["per_rotation"].items()
        if error is not None
    ]
    return min(float(np.sqrt(np.mean(squares))), before["rmse_deg"]) if squares else None


def _rotations(steps: Sequence[Mapping[str, Any]], floors: Mapping[str, float], method: str) -> str:
    names = list(steps[-1]["per_rotation"])
    heads = ["rotation", *(_label(step, method) for step in steps), "noise floor"]
    rows = [
        [name, *(_degrees(step["per_rotation"].get(name)) for step in steps), _degrees(floors.get(name))]
        for name in sorted(names, key=lambda name: -(steps[0]["per_rotation"].get(name) or 0.0))
    ]
    return table(heads, rows)


def _row(step: Mapping[str, Any], method: str) -> tuple[str, ...]:
    added, model = step["added"] or {}, (step.get("model") or "-")[:12]
    where = ", ".join(added.get("where") or ()) or "-"
    rivals = [name for name in added.get("confidence_set") or () if name != added["effect"]]
    verdict = added.get("verdict", "-") + (f" (or {', '.join(rivals)})" if rivals else "")
    return model, _label(step, method), where, verdict, _degrees(step["rmse_deg"])


def _label(step: Mapping[str, Any], method: str) -> str:
    return method if step["added"] is None else f"+ {step['added']['effect']}"


def _degrees(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
