"""``python3 do.py study active``: is the active protocol as good as the fixed one in less time?

Simulated gloves are sampled by the fixed protocol (``fk_only``), by its steps in any order, by candidates of
the active protocol in any order, and by the active protocol. After equal capture time a model is trained
from each, and judged on a free motion and on the paper's nine poses of another seed. ``trained``: LMC-GPR as
the product trains it; ``assumed``: the same samples with hyperparameters that are not learned from them.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from active_glove import FULL_S, GROWING_WAYS, SHARES, WAYS, ActiveGlove, glove_answer
from finished_gloves import FinishedGloves, software_hash
from intervals import bootstrap

from glovecal_models.worker_processes import pin_blas_to_one_thread

mpl.use("Agg")
import matplotlib.pyplot as plt

HOWS, TESTS = ("trained", "assumed"), ("free", "poses")
COLOURS = ("#555555", "#d9822b", "#3f9c6b", "#1d6cab")
SMOKE_S = 30.0
FIRST_SEED = 20
"""Gloves of smaller seeds were looked at while the protocol was made."""
Answers = Sequence[Mapping[str, Any]]


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="do.py study active", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--gloves", type=int, default=6, help="simulated gloves (default 6)")
    parser.add_argument("--folder", type=Path, default=Path(".study"), help="for answers, table, picture")
    smoke = "one glove, sampled for half a minute, in a temporary folder: seconds"
    parser.add_argument("--smoke", action="store_true", help=smoke)
    options = parser.parse_args(arguments)
    pin_blas_to_one_thread()
    if options.smoke:
        print(table([glove_answer(ActiveGlove(FIRST_SEED, SMOKE_S), GROWING_WAYS)]))
        return 0
    kept = FinishedGloves(options.folder, "active", software_hash())
    answers = [answer_of(ActiveGlove(FIRST_SEED + number), kept) for number in range(options.gloves)]
    text = table(answers)
    print(text)
    (options.folder / "active.md").write_text(f"# Active sampling\n\n{text}\n", encoding="utf-8")
    draw(answers, options.folder / "active.png")
    print(f"\nwritten: {options.folder / 'active.md'} and active.png beside it")
    return 0


def answer_of(glove: ActiveGlove, kept: FinishedGloves) -> dict[str, Any]:
    key = json.dumps(asdict(glove), sort_keys=True)
    answer = kept.get(key)
    if answer is None:
        answer = glove_answer(glove)
        kept.keep(key, answer)
        print(f"glove {glove.seed}: done", file=sys.stderr, flush=True)
    return answer


def table(answers: Answers) -> str:
    """Means over gloves, with 95 % intervals of the mean; then when the fixed protocol's error is reached."""
    head = "| way | capture (s) | samples | " + " | ".join(f"{how}, {test} (°)" for how, test in _columns())
    lines = [f"{head} |", "|---" * (3 + len(_columns())) + "|"]
    for way, place in _rows(answers):
        points = [point for answer in answers if (point := _at(answer[way], place)) is not None]
        capture = np.mean([point["capture_s"] for point in points])
        samples = np.mean([point["samples"] for point in points])
        cells = [_interval([point[f"{how}_{test}_deg"] for point in points]) for how, test in _columns()]
        lines.append(f"| {way} | {capture:.0f} | {samples:.0f} | {' | '.join(cells)} |")
    return "\n".join([*lines, "", *reached_sentences(answers)])


def reached_sentences(answers: Answers) -> list[str]:
    """What the active protocol needs for the error of the whole fixed one, glove by glove; none without."""
    if not all("fixed" in answer for answer in answers):
        return []
    told = []
    for how, test in _columns():
        shares = [reached(answer, f"{how}_{test}_deg") for answer in answers]
        found = [share for share in shares if share is not None]
        name = f"{how}, {test}"
        if not found:
            told.append(f"{name}: the active protocol never reached the whole fixed protocol's error.")
            continue
        time, samples = np.median([share[0] for share in found]), np.median([share[1] for share in found])
        told.append(
            f"{name}: the whole fixed protocol's error is reached on {len(found)} of {len(shares)} gloves, "
            f"with {100 * time:.0f} % of its capture time and {100 * samples:.0f} % of its samples (median)."
        )
    return told


def reached(answer: Mapping[str, Any], error: str) -> tuple[float, float] | None:
    """Shares of time and samples at the first point that is no worse than the fixed protocol's end."""
    whole = answer["fixed"][-1]
    for point in answer["active"]:
        if point[error] <= whole[error]:
            return point["capture_s"] / whole["capture_s"], point["samples"] / whole["samples"]
    return None


def draw(answers: Answers, path: Path) -> None:
    """Error over capture time, one panel for each way of learning."""
    figure, panels = plt.subplots(1, len(HOWS), figsize=(11, 4.2), sharey=True, constrained_layout=True)
    for panel, how in zip(panels, HOWS, strict=True):
        for way, colour in zip(WAYS, COLOURS, strict=True):
            rows = [place for name, place in _rows(answers) if name == way]
            points = [[p for a in answers if (p := _at(a[way], place)) is not None] for place in rows]
            x = [np.mean([point["capture_s"] for point in some]) for some in points]
            y = [np.mean([point[f"{how}_free_deg"] for point in some]) for some in points]
            panel.plot(x, y, "o-", color=colour, label=way, markersize=4)
        panel.set_title(f"{how} hyperparameters", loc="left", fontsize=10)
        panel.set_xlabel("capture time, s (countdowns included)")
        panel.axvline(0.6 * FULL_S, color="#bbbbbb", linewidth=0.8, linestyle="dashed")
        panel.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylim(bottom=0)
    panels[0].set_ylabel("RMSE on a free motion, degrees\n(mean over simulated gloves)")
    panels[0].legend(fontsize=8, frameon=False)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _columns() -> list[tuple[str, str]]:
    return [(how, test) for how in HOWS for test in TESTS]


def _rows(answers: Answers) -> list[tuple[str, int]]:
    """Way and place of its point; -1 is its end."""
    return [
        (way, place)
        for way in WAYS
        for place in ([] if way == "fixed" else [*range(len(SHARES))]) + [-1]
        if any(way in answer and _at(answer[way], place) is not None for answer in answers)
    ]


def _at(points: Sequence[Mapping[str, Any]], place: int) -> Mapping[str, Any] | None:
    if place < 0:
        return points[-1]
    cuts = [point for point in points if not point["is_end"]]
    return cuts[place] if place < len(cuts) else None


def _interval(values: Sequence[float]) -> str:
    low, high = bootstrap(values)
    return f"{np.mean(values):.2f} ({low:.2f} to {high:.2f})"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
