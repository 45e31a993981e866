"""What was hidden against what was named, as a matrix of counts and shares."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
from diagnosis_answer import NOTHING
from glove_jobs import Row

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.patches import Rectangle

UNKNOWN_COLUMN = "context:…"
DARK = 0.55
"""Share from which a cell's text is white."""


def draw_confusion(rows: Sequence[Row], title: str, path: Path) -> None:
    """Write ``path`` with its ending, one row of cells for each truth in the order of ``rows``."""
    counts: dict[str, Counter[str]] = {}
    for glove, answer in rows:
        counts.setdefault(_truth(glove.truth, glove.linear), Counter())[_named(answer["first"])] += 1
    truths = list(counts)
    names = _columns(truths, counts)
    figure, axes = plt.subplots(
        figsize=(0.62 * len(names) + 3.6, 0.46 * len(truths) + 3.0), constrained_layout=True
    )
    shares = [[counts[truth][name] / counts[truth].total() for name in names] for truth in truths]
    image = axes.imshow(shares, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for place, truth in enumerate(truths):
        for column, name in enumerate(names):
            if counts[truth][name]:
                share = shares[place][column]
                colour = "white" if share > DARK else "black"
                text = f"{counts[truth][name]}\n{100 * share:.0f} %"
                axes.text(column, place, text, ha="center", va="center", fontsize=7, color=colour)
            if name in _right(truth):
                axes.add_patch(Rectangle((column - 0.5, place - 0.5), 1, 1, fill=False, edgecolor="#c05020"))
    axes.set_xticks(range(len(names)), names, rotation=55, ha="right", rotation_mode="anchor", fontsize=8)
    totals = {truth: counts[truth].total() for truth in truths}
    labels = [f"{truth} ({total} {'glove' if total == 1 else 'gloves'})" for truth, total in totals.items()]
    axes.set_yticks(range(len(truths)), labels, fontsize=8)
    axes.set_xlabel("named first by the diagnosis")
    axes.set_ylabel("hidden in the glove")
    axes.set_title(f"{title}\ncells: gloves, and share of the row; framed: right", fontsize=10, loc="left")
    figure.colorbar(image, ax=axes, label="share of the row", shrink=0.7)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _truth(truth: str, linear: bool) -> str:
    return f"none, {'linear' if linear else 'flexible'} base" if truth == "none" else truth


def _right(truth: str) -> tuple[str, ...]:
    """Every glove's curve is a little bent, which a straight line leaves; an unknown cause has no name."""
    if truth.startswith("unknown:"):
        return (UNKNOWN_COLUMN,) if truth == "unknown:context" else (NOTHING,)
    if truth.startswith("none"):
        return (NOTHING, "nonlinearity") if "linear" in truth else (NOTHING,)
    return (truth,)


def _named(first: str) -> str:
    return UNKNOWN_COLUMN if first.startswith("context:") else first


def _columns(truths: Sequence[str], counts: dict[str, Counter[str]]) -> list[str]:
    """Truths that are names first, so that right ones lie on the diagonal; then other names; then nothing."""
    own = [truth for truth in truths if not truth.startswith(("none", "unknown:"))]
    others = sorted({name for row in counts.values() for name in row} - {*own, NOTHING, UNKNOWN_COLUMN})
    return [*own, *others, UNKNOWN_COLUMN, NOTHING]
