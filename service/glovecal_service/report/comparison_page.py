"""A comparison as a page: a model against takes, where its error is, and what it depends on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.comparison.answer import Comparison, SideBySide, seen_note
from glovecal_models.comparison.error_spectrum import SLOW_HZ, ErrorSpectrum
from glovecal_models.comparison.noise_floor import RotationNoise
from glovecal_models.comparison.residuals import Residuals, TakeResiduals
from glovecal_models.comparison.where.answer import CLOSE_UPS, SMALL, WhereItFails
from glovecal_models.comparison.where_it_fails import windows
from glovecal_models.effect_block import block_of
from glovecal_models.improvement.fall.lineage import lineage_fall
from glovecal_models.presentation.document import (
    Chart,
    Column,
    Note,
    Part,
    Pictures,
    Presentation,
    Section,
    Table,
    counted,
    first_of,
)
from glovecal_models.presentation.drawing import FLOOR, MEASURED, MODEL, QUIET, legend_above
from glovecal_models.takes.take import Take

MOST_POINTS = 1500
SHOWN_S = 12.0


def comparison_page(
    model: CalibrationModel,
    compared: Comparison,
    where: WhereItFails,
    found: Residuals,
    noise: Mapping[str, RotationNoise],
    others: Sequence[Comparison] = (),
    ancestors: Sequence[CalibrationModel] = (),
    simpler: Mapping[str, CalibrationModel] | None = None,
) -> Presentation:
    """``model`` looked at closely, ``others`` beside it.

    ``ancestors``, oldest first, and ``simpler`` calibrations show how the error fell down to ``model``.
    """
    takes = [item.take for item in found.takes]
    line, scale = [*ancestors, model], simpler or {}
    fall: list[Part] = [lineage_fall(line, scale, takes, compared.overall)] if ancestors else []
    effects = [block_of(one) for one in model.effects]
    pictures = {
        item.rotation: _pictures(found, noise[item.rotation], item.rotation)
        for item in where.rotations[:CLOSE_UPS]
    }
    beside: list[Part] = [SideBySide([compared, *others]).chart()] if others else []
    simulated = ["At least one of these takes comes from a simulated glove."] * compared.simulated
    return Presentation(
        f"Errors of {compared.title} ({counted(len(takes), 'take')})",
        [where.verdict, *compared.facts, *where.place, *compared.known_ceiling, *where.next],
        [*(Note("", [sentence]) for sentence in simulated), *seen_note([compared, *others])],
        [
            Section("Models side by side", beside),
            Section("How the error falls", fall),
            Section("Effects in the model", effects),
            *compared.sections,
            *where.sections(pictures),
            Section("Details", [_details(model, [compared, *others], takes)]),
        ],
    )


def _pictures(found: Residuals, noise: RotationNoise, rotation: str) -> list[Part]:
    small = [measured_against_predicted(found, rotation)]
    if noise.spectrum is not None:
        small.append(spectrum_of(noise.spectrum, rotation))
    return [over_time(found, rotation), Pictures(small)]


def _details(model: CalibrationModel, compared: Sequence[Comparison], takes: Sequence[Take]) -> Table:
    frames = sum(len(take.time_s) for take in takes)
    main, *others = compared
    rows = [
        ("model", main.model), ("method", model.method), ("subject", model.subject),
        ("layout", model.layout.name),
        ("takes", f"{first_of([take.name for take in takes])}; {frames} frames"),
        *((other.name, other.model) for other in others),
    ]  # fmt: skip
    return Table([Column("detail", ""), Column("value", "")], rows)


def over_time(found: Residuals, rotation: str) -> Chart:
    """Prediction with its claimed band and measurement, errors below, around the worst time; and where."""
    column = found.column(rotation)
    item, rows = _worst_window(found, column)
    time = item.take.time_s[rows] - item.take.start_s
    predicted, sd = item.predicted[rows, column], item.sd[rows, column]
    measured, error = item.measured[rows, column], item.error[rows, column]

    def draw(figure: Figure) -> None:
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        band = (predicted - 2 * sd, predicted + 2 * sd)
        above.fill_between(time, *band, color=MODEL, alpha=0.2, linewidth=0, label="± 2 claimed sd")
        above.plot(time, predicted, color=MODEL, linewidth=1.2, label="predicted")
        above.plot(time, measured, color=MEASURED, linewidth=1.2, linestyle=":", label="measured")
        above.set_ylabel(f"{rotation}, degrees")
        legend_above(above)
        below.fill_between(time, -2 * sd, 2 * sd, color=MODEL, alpha=0.2, linewidth=0)
        below.axhline(0, color=QUIET)
        below.plot(time, error, color=MODEL, linewidth=1)
        below.set(xlabel=f"seconds of take {item.take.name}", ylabel="error, degrees")

    known = np.isfinite(error)
    outside = float(np.mean(np.abs(error[known]) > 2 * sd[known])) if known.any() else 0.0
    sentence = (
        f"Take {item.take.name}, {time[0]:.0f} to {time[-1]:.0f} s: {100 * outside:.0f} % of errors are "
        "outside two claimed standard deviations (expected: 5 %)."
    )
    return Chart(None, 9, 4, sentence, panels=draw)


def _worst_window(found: Residuals, column: int) -> tuple[TakeResiduals, np.ndarray]:
    """The take and frames (every so many) of the worst ``SHOWN_S`` seconds of a rotation."""
    best: tuple[float, TakeResiduals, slice] | None = None
    for item in found.takes:
        time, squared = item.take.time_s, item.error[:, column] ** 2
        for rows in windows(time, SHOWN_S):
            known = squared[rows][np.isfinite(squared[rows])]
            if len(known) > 1 and (best is None or known.mean() > best[0]):
                best = (float(known.mean()), item, rows)
    if best is None:
        item = max(found.takes, key=lambda one: int(np.isfinite(one.error[:, column]).sum()))
        return item, np.arange(len(item.take.time_s))
    _, item, rows = best
    return item, np.arange(rows.start, rows.stop)[:: -(-(rows.stop - rows.start) // MOST_POINTS)]


def measured_against_predicted(found: Residuals, rotation: str) -> Chart:
    """Every frame as a point (at most ``MOST_POINTS``), the line through them, and where that line is off."""
    column = found.column(rotation)
    measured, predicted = found.stacked("measured")[:, column], found.stacked("predicted")[:, column]
    known = np.isfinite(measured) & np.isfinite(predicted)
    measured, predicted = measured[known], predicted[known]
    low, high = np.percentile(measured, [2.5, 97.5])
    ends = np.array([low, high])
    slope = _slope(measured, predicted)
    line = predicted.mean() + slope * (ends - measured.mean())
    scatter = float(np.std(predicted - slope * measured))
    step = -(-len(measured) // MOST_POINTS)

    def draw(axes: Axes) -> None:
        axes.plot(measured[::step], predicted[::step], ".", color=MODEL, alpha=0.35, markersize=3)
        axes.axline((float(low), float(low)), slope=1, color=MEASURED, linewidth=1, label="no error")
        axes.plot(ends, line, color=FLOOR, linewidth=1.5, label="linear fit")
        axes.set(xlabel=f"{rotation} measured, degrees", ylabel="predicted, degrees")
        legend_above(axes, 2)

    low_off, high_off = line - ends
    sentence = (
        f"From {round(low)} to {round(high)} degrees (95 % of frames) the linear fit is off by "
        f"{low_off:+.1f} degrees at the low end and {high_off:+.1f} at the high end; residual SD "
        f"{scatter:.1f} degrees."
    )
    return Chart(draw, *SMALL, sentence)


def _slope(measured: np.ndarray, predicted: np.ndarray) -> float:
    centred = measured - measured.mean()
    square = float(centred @ centred)
    return float(centred @ predicted) / square if square > 0 else 1.0


def spectrum_of(spectrum: ErrorSpectrum, rotation: str) -> Chart:
    """The error's spectrum with the plateau of its noise, and how much of it is slow."""
    frequency, density = spectrum.frequency_hz, spectrum.density

    def draw(axes: Axes) -> None:
        axes.axvspan(frequency[0], SLOW_HZ, color=QUIET, alpha=0.4, linewidth=0, label="slow")
        axes.plot(frequency, np.maximum(density, 1e-12), color=MODEL, linewidth=1.2)
        if spectrum.plateau_density > 0:
            axes.axhline(spectrum.plateau_density, color=FLOOR, linestyle="--", label="white-noise plateau")
        axes.set(xscale="log", yscale="log", xlabel="hertz", ylabel="error, degrees² / hertz")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=12))
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axis.set_minor_formatter(NullFormatter())
        legend_above(axes, 2)

    sentence = (
        f"{100 * spectrum.slow_share:.0f} % of the variance of {rotation}'s error is slower than "
        f"{SLOW_HZ:.0f} Hz (95 % interval {100 * spectrum.slow_low:.0f} to {100 * spectrum.slow_high:.0f}); "
        f"white noise from the plateau: {spectrum.plateau.floor_deg:.2f} degrees."
    )
    return Chart(draw, *SMALL, sentence)
