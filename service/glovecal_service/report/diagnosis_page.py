"""A diagnosis as a page, made from its document alone."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from glovecal_service.report.diagnosis_pictures import (
    errors_beside_floors,
    heat_of_candidates,
    saved_beside_decoys,
)
from glovecal_service.report.hold_table import hold_table
from glovecal_service.report.html import figure, listed, table, whole_page
from glovecal_service.report.sentences import counted

HEADS = ("effect", "where", "error before", "with it", "with its decoy", "beyond chance")
LEFT_HEADS = (
    "what is left goes with", "rotation", "explains, degrees", "probability by chance, all columns counted",
)  # fmt: skip
SCALE = (
    "Degrees, on takes left out, readings and reference smoothed alike. A decoy has the same freedom as its "
    "effect and cannot be right: what it saves, flexibility saves."
)


def diagnosis_page(found: Mapping[str, Any]) -> str:
    """HTML. Keys that a diagnosis of another version lacks are left out."""
    model, takes = str(found.get("model", "")), found.get("takes") or []
    names = ", ".join(take["name"] for take in takes[:12]) + (" ..." if len(takes) > 12 else "")
    named, rotations = found.get("named"), found.get("rotations") or {}
    candidates = found.get("candidates") or []
    headline = named["sentence"] if named else "No known effect saves more than its decoy and chance do."
    held = found.get("hold_drift")
    if held:
        headline = held["sentence"]
    parts = [
        f"<h1>What model {escape(model[:12])} lacks, by {counted(len(takes), 'take')}</h1>",
        f"<p>Takes: {escape(names)}.</p>" if names else "",
        *_warned("The reference first", found.get("reference_problems")),
        *_warned("Found in the recording", [item["sentence"] for item in found.get("findings") or ()]),
        f"<p><strong>{escape(headline)}</strong></p>",
        _next_take(found.get("next_take")),
        *_left(found.get("something_left") or {}),
    ]
    if candidates:
        parts += ["<h2>What was tried</h2>", figure(*saved_beside_decoys(candidates))]
        heat = heat_of_candidates(candidates)
        parts += [figure(*heat)] if heat is not None else []
        parts += [_table(candidates), f"<p>{escape(SCALE)}</p>"]
    if held and held["poses"]:
        parts += ["<h2>What readings do while a pose is held</h2>", hold_table(held)]
    if rotations and not held:
        parts += ["<h2>How far off each rotation is</h2>", figure(*errors_beside_floors(rotations))]
    why = [f"{item['effect']}: {item['why']}" for item in found.get("not_judgeable") or ()]
    if why:
        parts += ["<h2>Cannot be judged from these takes</h2>", listed(why)]
    return whole_page(f"diagnosis of model {model[:12]}", parts)


def _warned(heading: str, sentences: list[str] | None) -> list[str]:
    if not sentences:
        return []
    return [f'<div class="note"><b>{escape(heading)}</b>{listed(sentences)}</div>']


def _next_take(following: Mapping[str, Any] | None) -> str:
    if not following:
        return ""
    rivals = " and ".join(following.get("separates") or ())
    text = f"To tell {rivals} apart record {following['seconds']} s: {following['what']}"
    return f'<p class="note">{escape(text)}</p>'


def _left(left: Mapping[str, Any]) -> list[str]:
    """Whether something is left, and the columns it goes with."""
    parts = [f"<p>{escape(left.get('sentence', ''))}</p>"]
    rows = [
        (item["phrase"], item["rotation"], _degrees(item["size_deg"]), f"{item['probability']:.3f}")
        for item in left.get("goes_with") or ()
    ]
    return [*parts, table(LEFT_HEADS, rows)] if rows else parts


def _table(candidates: list[Mapping[str, Any]]) -> str:
    rows = [
        (
            item["effect"],
            ", ".join(item.get("where") or ()) or "-",
            *(_degrees(item.get(f"rmse_{when}_deg")) for when in ("before", "after", "decoy")),
            "yes" if item.get("passes") else "no",
        )
        for item in candidates
    ]
    return table(HEADS, rows)


def _degrees(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
