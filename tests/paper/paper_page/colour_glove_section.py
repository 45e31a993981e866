"""The colour glove's figures on the page."""

from __future__ import annotations

from collections.abc import Sequence

from colour_glove import (
    BITS,
    PAPER_GAIN,
    PAPER_RANK,
    PAPER_RANK_SD,
    RERANKED,
    SAMPLINGS,
    CodeRow,
    CoverageRow,
)
from colour_glove_chain import ChainRow, DepthRow
from colour_glove_motion import MotionRow
from matplotlib.figure import Figure
from paper_page.colour_glove_poses_section import poses_parts
from paper_page.parts import figure, figure_svg, table
from paper_page.section import Demand, Section

from glovecal_models.presentation.drawing import FLOOR, MODEL

COVERAGE_HEADS = (
    *("entries", "sampling", "nearest in pose, mm", "nearest in image, px²"),
    *("pose of that one: mm", "joints, degrees"),
)
CODE_HEADS = (
    *("code", "rank of the true neighbour, paper", "ours", "median", f"within {RERANKED}", "learned in"),
    *("look-up", "gain over brute force, paper", "ours", "must reach"),
)
COLOURS = dict(zip(SAMPLINGS, (MODEL, FLOOR), strict=True))
MOST_RANK, MOST_MS = 16.0, 5.0
TICKS = (1, 3, 10, 30, 100, 300)
NOTE = (
    "All images are <b>rendered</b>, clean, and of the hand model that filled the database: bounds of what "
    "photographs give. Hands looked up were not among the poses the database is made of. Millimetres are "
    "root mean squares over the skin's vertices, turned palm included. The paper prints Figures 8 and 9 "
    "without numbers, but for its 192 bits. Greedy low-dispersion sampling makes the largest gap small, not "
    "the mean distance: rare hand shapes count as much as frequent ones. Times "
    "are processor times of one thread."
)


def colour_glove_section(
    coverage: Sequence[CoverageRow],
    codes: Sequence[CodeRow],
    chain: Sequence[ChainRow] = (),
    depth: Sequence[DepthRow] = (),
    motion: Sequence[MotionRow] = (),
) -> Section:
    """Of what is known: of an interrupted run a part."""
    known, wanted = poses_parts(chain, depth, motion)
    searched, asked = _search(coverage, codes) if coverage and codes else ((), ())
    return Section((*searched, *known), (*asked, *wanted))


def _search(
    coverage: Sequence[CoverageRow], codes: Sequence[CodeRow]
) -> tuple[tuple[str, ...], tuple[Demand, ...]]:
    """Figures 8 and 9."""
    rows = sorted(coverage, key=lambda row: (row.entries, row.sampling))
    sizes = [
        (
            f"{row.entries:,}",
            row.sampling,
            f"{row.pose_nearest_mm:.1f}",
            f"{row.image_nearest_px2:.2f}",
            f"{row.found_mm:.1f}",
            f"{row.found_deg:.1f}",
        )
        for row in rows
    ]
    cells, demands = [], []
    for row in codes:
        gain, is_papers, mark = row.brute_ms / row.look_up_ms, row.code == "192 bits", "-"
        if is_papers:
            demands.append(
                Demand(f"rank of the true neighbour, {row.code}", row.rank_mean, MOST_RANK, "entries")
            )
            mark = demands[-1].mark()
        demands.append(Demand(f"look-up, {row.code}", row.look_up_ms, MOST_MS, "ms"))
        papers = (f"{PAPER_RANK:g} ± {PAPER_RANK_SD:g}", f"{PAPER_GAIN:g}") if is_papers else ("-", "-")
        ours = f"{row.rank_mean:.1f} ± {row.rank_sd:.1f}"
        times = "-" if row.learned_s is None else f"{row.learned_s:.1f} s", f"{row.look_up_ms:.2f} ms"
        found = f"{row.rank_median:g}", f"{100 * row.within:.1f} %"
        cells.append((row.code, papers[0], ours, *found, *times, papers[1], f"{gain:.0f}", mark))
    brute = codes[0]
    sentence = (
        f"{brute.entries:,} entries, {brute.queries} hands held out; brute force {brute.brute_ms:.0f} ms."
    )
    return (
        (
            figure(_sizes(rows), "Figure 8: means over the hands held out, by size of the database."),
            table(COVERAGE_HEADS, sizes),
            figure(_ranks(codes), f"Figure 9: {sentence}"),
            table(CODE_HEADS, cells),
            f"<p>{NOTE}</p>",
        ),
        tuple(demands),
    )


def _sizes(rows: Sequence[CoverageRow]) -> str:
    ticks = sorted({row.entries for row in rows})

    def draw(figure: Figure) -> None:
        pose, image = figure.subplots(1, 2)
        for sampling, colour in COLOURS.items():
            own = [row for row in rows if row.sampling == sampling]
            entries = [row.entries for row in own]
            pose.plot(
                entries,
                [row.pose_nearest_mm for row in own],
                "o-",
                color=colour,
                label=f"nearest in pose, {sampling}",
            )
            pose.plot(
                entries,
                [row.found_mm for row in own],
                "s--",
                color=colour,
                label=f"found by image, {sampling}",
            )
            image.plot(entries, [row.image_nearest_px2 for row in own], "o-", color=colour, label=sampling)
        for axes, unit in ((pose, "vertex RMS distance, mm"), (image, "image distance, px²")):
            axes.set_xscale("log")
            axes.set_xticks(ticks, [f"{tick:,}" for tick in ticks])
            axes.minorticks_off()
            axes.set_xlabel("entries")
            axes.set_ylabel(unit)
            axes.set_ylim(bottom=0)
            axes.legend(fontsize=8, loc="lower left")

    return figure_svg(draw, 9.5, 3.6)


def _ranks(rows: Sequence[CodeRow]) -> str:
    own = [row for row in rows if row.code.endswith("bits")]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.plot(
            BITS[: len(own)], [row.rank_mean for row in own], "o-", color=MODEL, label="boosted bits, mean"
        )
        axes.plot(192, PAPER_RANK, "k+", markersize=12, label="the paper's 192 bits")
        for row, style in zip([row for row in rows if row.code.startswith("PCA")], (":", "--"), strict=False):
            axes.axhline(row.rank_mean, color=FLOOR, linestyle=style, label=f"{row.code} numbers")
        axes.set_yscale("log")
        axes.set_yticks(TICKS, [f"{tick:g}" for tick in TICKS])
        axes.minorticks_off()
        axes.set_ylim(bottom=1)
        axes.set_xticks(BITS)
        axes.set_xlabel("bits")
        axes.set_ylabel("rank of the true neighbour")
        axes.legend(fontsize=8)

    return figure_svg(draw, 6.5, 3.4)
