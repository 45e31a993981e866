"""Table 4 and Figure 14 on the page."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from paper_page.beside import seconds
from paper_page.parts import figure, figure_svg, table
from paper_page.section import Section
from table_4 import Table4Row

from glovecal_models.presentation.drawing import FLOOR, MODEL, QUIET

HEADS = (
    *("M", "training, paper", "ours", "one frame, paper", "ours"),
    *("FK error", "IK error", "trained pseudo-inputs kept"),
)
NOTE = (
    "FK error: RMSE over all rotations in the nine poses of Table 3, in a wearing that nobody trained on; IK "
    "error: mean distance of the tips while thumb and finger touch, mean over four fingers. Training: of a "
    "whole glove, with the exact process that each search starts from. Times are CPU seconds of one thread; "
    "the paper's were taken on a Core 2 Duo at 2.8 GHz, so a ratio of the two says little; its 16 ms stand "
    "for “at most”. A rotation that is read from one 8-bit sensor has no more pseudo-inputs than readings. "
    "“Kept”: with free pseudo-inputs SPGP may explain noise away; where the exact likelihood refuses that, "
    "the exact process's own parameters are served on well-chosen readings instead."
)


def table_4_section(rows: Sequence[Table4Row]) -> Section:
    cells = [
        (
            "LMC-GPR, exact" if row.size is None else str(row.size),
            seconds(row.paper_train_s),
            seconds(row.train_s),
            seconds(row.paper_frame_s),
            seconds(row.frame_s),
            f"{row.fk_deg:.2f}°",
            f"{row.ik_cm:.2f} cm",
            "-" if row.size is None else f"{row.kept} of {row.rotations}",
        )
        for row in rows
    ]
    return Section(
        (
            figure(_times(rows), "Time against M: the paper's computer is another one."),
            figure(_accuracy(rows), _sentence(rows)),
            table(HEADS, cells),
            f"<p>{NOTE}</p>",
        )
    )


def _sentence(rows: Sequence[Table4Row]) -> str:
    exact = next(row for row in rows if row.size is None)
    chosen = next((row for row in rows if row.size == 100), rows[0])
    return (
        "Figure 14 (the paper prints its curves without numbers): with M = 100, the paper's choice, the "
        f"poses are off by {chosen.fk_deg:.2f} degrees and touching tips by {chosen.ik_cm:.2f} cm; the exact "
        f"process: {exact.fk_deg:.2f} degrees, {exact.ik_cm:.2f} cm (dashed)."
    )


def _times(rows: Sequence[Table4Row]) -> str:
    sized = [row for row in rows if row.size is not None]
    sizes = [row.size for row in sized]

    def draw(figure: Figure) -> None:
        training, frame = figure.subplots(1, 2)
        training.plot(sizes, [row.paper_train_s for row in sized], "o-", color=QUIET, label="paper")
        training.plot(sizes, [row.train_s for row in sized], "o-", color=MODEL, label="ours")
        frame.plot(sizes, [1e3 * (row.paper_frame_s or 0) for row in sized], "o-", color=QUIET)
        frame.plot(sizes, [1e3 * row.frame_s for row in sized], "o-", color=MODEL)
        training.set(ylabel="training a glove, seconds", xlabel="M")
        frame.set(ylabel="one frame of a glove, ms", xlabel="M")
        frame.axhline(1e3 / 120, color=FLOOR, linewidth=1, label="120 frames a second")
        for axes in (training, frame):
            _by_size(axes, sizes)
            axes.set_yscale("log")
            axes.legend(frameon=False)

    return figure_svg(draw, 9, 3.4)


def _accuracy(rows: Sequence[Table4Row]) -> str:
    sized = [row for row in rows if row.size is not None]
    exact = next(row for row in rows if row.size is None)
    sizes = [row.size for row in sized]

    def draw(figure: Figure) -> None:
        fk, ik = figure.subplots(1, 2)
        fk.plot(sizes, [row.fk_deg for row in sized], "o-", color=MODEL)
        fk.axhline(exact.fk_deg, color=MODEL, linestyle="--", linewidth=1)
        fk.set(ylabel="FK error, degrees", xlabel="M")
        ik.plot(sizes, [row.ik_cm for row in sized], "o-", color=MODEL)
        ik.axhline(exact.ik_cm, color=MODEL, linestyle="--", linewidth=1)
        ik.set(ylabel="IK error, cm", xlabel="M")
        for axes, errors in ((fk, [row.fk_deg for row in rows]), (ik, [row.ik_cm for row in rows])):
            _by_size(axes, sizes)
            axes.set_ylim(0, 1.2 * max(errors))

    return figure_svg(draw, 9, 3.2)


def _by_size(axes: Axes, sizes: Sequence[int | None]) -> None:
    axes.set_xscale("log")
    axes.set_xticks([size for size in sizes if size], [str(size) for size in sizes])
    axes.minorticks_off()
