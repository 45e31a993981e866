"""An independence examination as a page, made from its document alone."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from glovecal_service.report.examination_pictures import deviations, matrix
from glovecal_service.report.html import figure, listed, table, whole_page
from glovecal_service.report.sentences import counted

HEADS = (
    "kept still", "affecting sensor", "std. dev., %", "95 % interval", "max. dev., %", "95 % interval",
    "affects",
)  # fmt: skip
LAYOUT_HEADS = ("rotation", "now", "read from", "proposed", "read from", "sure")


def examination_page(found: Mapping[str, Any]) -> str:
    """HTML."""
    rows = found["rotations"]
    parts = [f"<h1>Which sensors stretch which others: {escape(found['layout'])}</h1>"]
    takes = counted(len(found["still"]), "take")
    parts.append(f"<p>{takes}, {counted(len(rows), 'rotation')} kept still.</p>")
    if found["sentences"]:
        parts.append(f'<div class="note"><b>Look at this first</b>{listed(found["sentences"])}</div>')
    if rows:
        parts += ["<h2>Who pulls on whom</h2>", figure(*matrix(found))]
        if found["one_way"]:
            parts += ["<p>Couplings are not two-way:</p>"]
            parts += [listed([item["sentence"] for item in found["one_way"]])]
        parts += ["<h2>How much in all</h2>", figure(*deviations(found))]
        parts += ["<h2>Each affecting sensor's own share</h2>", table(HEADS, _shares(rows))]
    examined = [item for item in found["proposals"] if item["is_sure"] is not None]
    if examined:
        parts += ["<h2>How each rotation should be read</h2>"]
        parts += [listed([item["sentence"] for item in examined])]
    changes = [item for item in examined if item["is_change"]]
    if changes:
        parts += ["<h2>What would change</h2>", table(LAYOUT_HEADS, [_change(item) for item in changes])]
        parts += ["<p>Nothing is changed until you keep it: glovecal take examine --keep NAME.</p>"]
    return whole_page(f"examination of {found['layout']}", parts)


def _shares(rows: list[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    return [
        (
            item["rotation"],
            share["sensor"],
            f"{share['std_pct']:.1f}",
            f"{share['std_low']:.1f} to {share['std_high']:.1f}",
            f"{share['max_pct']:.1f}",
            f"{share['max_low']:.1f} to {share['max_high']:.1f}",
            share["affects"],
        )
        for item in rows
        for share in item["affecting"]
    ]


def _change(item: Mapping[str, Any]) -> tuple[str, ...]:
    sure = "yes" if item["is_sure"] else "no"
    now, then = ", ".join(item["sensors_now"]), ", ".join(item["sensors"])
    return item["rotation"], item["kind_now"], now, item["kind"], then, sure
