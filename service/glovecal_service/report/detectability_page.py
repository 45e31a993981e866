"""What takes could have shown as a page, made from its document alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes

from glovecal_service.report.caption import Caption
from glovecal_service.report.drawing import CONTROL, FLOOR, MODEL, QUIET, legend_above, svg
from glovecal_service.report.html import (
    Fact,
    Section,
    counted,
    degrees,
    figure,
    listed,
    names_of,
    page,
    paragraph,
    table,
)
from glovecal_service.views.detectability import size_text

OUTCOMES = {
    "named": ("named alone", MODEL),
    "ambiguous": ("named together with others", FLOOR),
    "mistaken": ("only others named", CONTROL),
    "not_found": ("not found", QUIET),
}
PAIR_HEADS = ("effects", "rotation", "correlation", "own part, %", "to separate them, record")
SIZE_HEADS = ("effect", "on", "50 % named, degrees", "80 % named, degrees", "50 % found, degrees")
METHOD = (
    "Each sensor reads what the fitted map makes of the measured angles; noise and nuisance are as measured, "
    "from other takes and moments. The effect is added: its size is the RMS of what no static map explains. "
    "Then the session is diagnosed again. Its shape is the middle of what the diagnosis searches."
)
ALIKE = (
    "Correlation of what one effect adds with its best imitation by the other, the static map projected out; "
    "own part: what is left of its size then. Found from the takes alone, before anything is named."
)
PAIRS_SHOWN = 20


def detectability_page(found: Mapping[str, Any], caption: Caption | None = None) -> str:
    """HTML. ``caption`` of the model, where there is one."""
    shown = [item for item in found["effects"] if item["why_not"] is None]
    refused = [f"{item['effect']}: {item['why_not']}" for item in found["effects"] if item["why_not"]]
    alike, trials = found["confusability"], found["trials"]
    sizes = [
        (
            item["effect"], ", ".join(item["rotations"]),
            *(size_text(item, item[name]) for name in ("named_50_deg", "named_80_deg", "found_50_deg")),
        )
        for item in shown
    ]  # fmt: skip
    grid = [figure(*outcomes_by_size(shown, trials)), table(SIZE_HEADS, sizes)] if shown else []
    noise = [(name, degrees(value)) for name, value in found["residual_deg"].items()]
    sections = [
        Section("Sizes that would have been named", [*grid, paragraph(METHOD)]),
        Section("Not shown at any size", [listed(list(dict.fromkeys(refused)))] if refused else []),
        Section(
            "Effects that are alike in these takes",
            [table(PAIR_HEADS, _pairs(alike["pairs"])), paragraph(ALIKE)],
        ),
        Section("What effects have to exceed", [table(("rotation", "noise and nuisance, ° RMS"), noise)]),
        Section("Details", [table(("", ""), _details(found))]),
    ]
    said = [item["sentence"] for item in shown] or ["No effect can be put into these takes."]
    summary = [Fact("Verdict", said[0]), *(Fact("", sentence) for sentence in said[1:])]
    summary += [Fact("", found["control"]["sentence"])]
    summary += [Fact("Alike", sentence) for sentence in alike["sentences"][-1:]]
    of = found["subject"] if caption is None else caption.title
    simulated = " (simulated glove)" if found.get("simulated") else ""
    takes = counted(len(found["takes"]), "take")
    return page(f"What {takes} of {of}{simulated} could have shown", summary, sections)


def outcomes_by_size(effects: Sequence[Mapping[str, Any]], trials: int) -> tuple[str, str]:
    """Effects by sizes, each cell split into what the trials ended in."""
    rows = list(effects)[::-1]
    sizes = [size["size_deg"] for size in rows[0]["sizes"]]

    def draw(axes: Axes) -> None:
        for row, item in enumerate(rows):
            for column, size in enumerate(item["sizes"]):
                left = column - 0.46
                for name, (_, colour) in OUTCOMES.items():
                    width = 0.92 * size[name] / max(size["trials"], 1)
                    axes.barh(row, width, left=left, height=0.5, color=colour)
                    left += width
                said = f"{size['named']}/{size['trials']}" if size["trials"] else "-"
                axes.text(column, row + 0.26, said, ha="center", va="bottom", fontsize=9)
        for label, colour in OUTCOMES.values():
            axes.barh([0], [0], color=colour, label=label)
        axes.set_xlim(-0.5, len(sizes) - 0.5)
        axes.set_ylim(-0.6, len(rows) - 0.3)
        axes.set_xticks(range(len(sizes)), [f"{size:g}" for size in sizes])
        axes.set_yticks(range(len(rows)), [_row_name(item) for item in rows])
        axes.set_xlabel("size of the effect, degrees RMS beyond any static map")
        legend_above(axes, 2)

    sentence = f"Above each cell: trials that name the effect alone, of {counted(trials, 'trial')}."
    return svg(draw, 3.2 + 1.1 * len(sizes), 1.6 + 0.55 * len(rows)), sentence


def _row_name(item: Mapping[str, Any]) -> str:
    where = item["rotations"]
    return f"{item['effect']}, {where[0] if len(where) == 1 else f'{len(where)} rotations'}"


def _pairs(pairs: Sequence[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    confused = sum(pair["is_confused"] for pair in pairs)
    return [
        (
            " and ".join(pair["effects"]),
            pair["rotation"],
            degrees(pair["correlation"]),
            f"{100 * (1 - min(pair['correlation'], 1.0) ** 2) ** 0.5:.0f}",
            f"{pair['next_take']['seconds']} s: {pair['next_take']['what']}" if pair["next_take"] else "-",
        )
        for pair in pairs[: max(PAIRS_SHOWN, confused)]
    ]


def _details(found: Mapping[str, Any]) -> list[tuple[str, str]]:
    worst = [value for value in found["confusability"]["condition"].values() if value is not None]
    infinite = len(worst) < len(found["confusability"]["condition"])
    condition = "infinite" if infinite or not worst else f"{max(worst):.0f}"
    return [
        ("model", str(found["model"] or "-")),
        ("takes", names_of(found["takes"]) or "-"),
        ("trials for each size", str(found["trials"])),
        ("condition number of all effects, largest rotation", condition),
    ]
