"""An independence examination as a page, made from its document alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from glovecal_service.report.caption import long_date
from glovecal_service.report.drawing import CARD, FLOOR, MEASURED, MODEL, QUIET, SHARES, legend_above, svg
from glovecal_service.report.html import (
    Fact,
    Section,
    counted,
    figure,
    listed,
    note,
    page,
    paragraph,
    table,
)

HEADS = (
    "joint kept still", "affecting sensor", "std. dev., %", "95 % interval", "max. dev., %", "95 % interval",
    "affects",
)  # fmt: skip
LAYOUT_HEADS = ("rotation", "now", "read from", "proposed", "read from", "significant")
MOST_SHOWN_PCT = 50.0


def examination_page(found: Mapping[str, Any], subject: str = "") -> str:
    """HTML."""
    rows = found["rotations"]
    examined = [item for item in found["proposals"] if item["is_sure"] is not None]
    changes = [item for item in examined if item["is_change"]]
    couplings = [figure(*matrix(found))] if rows else []
    if found["one_way"]:
        couplings += [paragraph("Couplings that act in one direction only:")]
        couplings += [listed([item["sentence"] for item in found["one_way"]])]
    proposals = [listed([item["sentence"] for item in examined])] if examined else []
    if changes:
        proposals.append(table(LAYOUT_HEADS, [_change(item) for item in changes]))
        proposals.append(paragraph("The layout stays as it is until you keep the proposal."))
    shares = _shares(rows)
    sections = [
        Section("Which sensor affects which", couplings),
        Section("Total deviation", [figure(*deviations(found))] if rows else []),
        Section("Deviation caused by each sensor alone", [table(HEADS, shares)] if shares else []),
        Section("Proposed layout", proposals),
    ]
    notes = [note("Check this first", found["sentences"])] if found["sentences"] else []
    of = f"{subject}, " if subject else ""
    today = long_date(datetime.now(UTC).date())
    return page(
        f"Cross-coupling of sensors: {of}layout {found['layout']}, {today}",
        _summary(found, changes),
        sections,
        notes=notes,
    )


def _summary(found: Mapping[str, Any], changes: Sequence[Mapping[str, Any]]) -> list[Fact]:
    rows = found["rotations"]
    coupled = [item for item in rows if item["is_coupled"]]
    facts = [
        Fact(
            "Verdict",
            f"{len(coupled)} of {counted(len(rows), 'examined sensor')} cross-coupled "
            f"({counted(len(found['still']), 'take')}); {counted(len(changes), 'change')} of the layout "
            "proposed.",
        )
    ]
    if rows:
        worst = max(rows, key=lambda item: item["std_pct"])
        facts.append(
            Fact(
                "Size",
                f"largest: {worst['std_pct']:.1f} % of the active range "
                f"(limit {found['rule']['std_pct']:g} %)",
            )
        )
        facts.append(Fact("Place", ", ".join(item["rotation"] for item in coupled) or "none"))
    command = "glovecal take examine --keep NAME" if changes else "glovecal train --subject SUBJECT"
    return [*facts, Fact("Next", command, is_command=True)]


def matrix(found: Mapping[str, Any]) -> tuple[str, str]:
    """Rows: rotations kept still; columns: affecting sensors; each cell the two deviations in per cent."""
    rows, columns = found["rotations"], found["sensors"]
    values = np.full((len(rows), len(columns)), np.nan)
    for row, item in enumerate(rows):
        for share in item["affecting"]:
            values[row, columns.index(share["sensor"])] = share["std_pct"]

    def draw(axes: Axes) -> None:
        image = axes.imshow(
            values, cmap=SHARES, aspect="auto", vmin=0, vmax=MOST_SHOWN_PCT, interpolation="none"
        )
        for row, item in enumerate(rows):
            _row(axes, row, item, columns)
        axes.set_xticks(range(len(columns)), columns, rotation=60, ha="right")
        axes.set_yticks(range(len(rows)), [item["rotation"] for item in rows])
        axes.set_xticks(np.arange(len(columns) + 1) - 0.5, minor=True)
        axes.set_yticks(np.arange(len(rows) + 1) - 0.5, minor=True)
        axes.grid(which="minor", color=QUIET, linewidth=0.5)
        axes.tick_params(which="minor", length=0)
        axes.set(xlabel="affecting sensor", ylabel="joint kept still")
        axes.figure.colorbar(image, ax=axes, label="standard deviation, % of range", shrink=0.8)

    return svg(draw, 2.8 + 0.56 * len(columns), 2.1 + 0.4 * len(rows)), _matrix_sentence(rows)


def deviations(found: Mapping[str, Any]) -> tuple[str, str]:
    """Standard and largest deviation of each still rotation, the rule's limits marked."""
    rows, rule = found["rotations"][::-1], found["rule"]

    def draw(axes: Axes) -> None:
        places = np.arange(len(rows))
        axes.barh(places + 0.2, [item["std_pct"] for item in rows], height=0.38, color=MODEL)
        axes.barh(places - 0.2, [item["max_pct"] for item in rows], height=0.38, color=QUIET)
        axes.barh([0], [0], color=MODEL, label="standard deviation")
        axes.barh([0], [0], color=QUIET, label="largest deviation")
        axes.axvline(rule["std_pct"], color=FLOOR, linewidth=1.2, label=f"{rule['std_pct']:g} % standard")
        axes.axvline(
            rule["max_pct"], color=FLOOR, linewidth=1.2, linestyle=":", label=f"{rule['max_pct']:g} % largest"
        )
        axes.set_yticks(places, [item["rotation"] for item in rows])
        axes.set_xlabel("% of the active range, while the joint is kept still")
        axes.set_xlim(0, None)
        legend_above(axes, 2)

    coupled = [item["rotation"] for item in found["rotations"] if item["is_coupled"]]
    alone = [item["rotation"] for item in found["rotations"] if not item["is_coupled"]]
    sentence = (
        f"Cross-coupled: {', '.join(coupled) or 'none'}. Independent: {', '.join(alone) or 'none'}. "
        "Above either limit: cross-coupled (Wang & Neff 2013)."
    )
    return svg(draw, 9, 1.4 + 0.3 * len(rows)), sentence


def _row(axes: Axes, row: int, item: Mapping[str, Any], columns: Sequence[str]) -> None:
    for name in item["not_moved"]:
        _fill(axes, row, columns.index(name), CARD, None)
    _fill(axes, row, columns.index(item["sensor"]), "none", "///")
    for share in item["affecting"]:
        column = columns.index(share["sensor"])
        dark = share["std_pct"] > 0.6 * MOST_SHOWN_PCT
        text = f"{share['std_pct']:.0f} | {share['max_pct']:.0f}"
        colour = "white" if dark else MEASURED
        axes.text(column, row, text, ha="center", va="center", fontsize=7.5, color=colour)
        if share["affects"] == "yes":
            axes.plot(column + 0.36, row - 0.33, "o", color=FLOOR, markersize=4)
        elif share["affects"] == "undecided":
            axes.text(column + 0.36, row - 0.3, "?", ha="center", va="center", color=FLOOR, weight="bold")


def _fill(axes: Axes, row: int, column: int, colour: str, hatch: str | None) -> None:
    axes.fill_between(
        [column - 0.5, column + 0.5], row - 0.5, row + 0.5, facecolor=colour, edgecolor=QUIET, hatch=hatch,
        linewidth=0,
    )  # fmt: skip


def _matrix_sentence(rows: Sequence[Mapping[str, Any]]) -> str:
    legend = (
        "Standard | largest deviation caused by each affecting sensor alone, % of the still sensor's active "
        "range. Dot: affects by the 5 % and 12 % rule; ?: undecided; grey: the sensor did not move alone, "
        "unknown; empty: no effect; hatched: the joint's own sensor."
    )
    shares = [
        (share["affects"] == "yes", share["std_pct"], share, item)
        for item in rows
        for share in item["affecting"]
    ]
    if not shares:
        return f"No sensor affects another. {legend}"
    _, size, share, item = max(shares, key=lambda one: one[:2])
    return (
        f"Largest: {share['sensor']} alone moves the reading of {item['sensor']} by {size:.0f} % "
        f"of its range ({share['std_low']:.0f} to {share['std_high']:.0f}), at most "
        f"{share['max_pct']:.0f} %. {legend}"
    )


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
