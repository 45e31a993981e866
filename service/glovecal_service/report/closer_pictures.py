"""The pictures of one rotation: measured against predicted, the error's spectrum, wearings."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from glovecal_models.comparison.error_spectrum import SLOW_HZ, ErrorSpectrum
from glovecal_models.comparison.residuals import Residuals
from glovecal_models.comparison.wearings import WearingErrors
from glovecal_service.report.drawing import FLOOR, MEASURED, MODEL, QUIET, svg

MOST_POINTS = 1500
WIDTH, HEIGHT = 4.4, 3.2


def measured_against_predicted(found: Residuals, rotation: str) -> tuple[str, str]:
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
        axes.axline((float(low), float(low)), slope=1, color=MEASURED, linewidth=1, label="without error")
        axes.plot(ends, line, color=FLOOR, linewidth=1.5, label="line through all frames")
        axes.set(xlabel=f"{rotation} measured, degrees", ylabel="predicted, degrees")
        axes.legend(frameon=False, fontsize=8)

    low_off, high_off = line - ends
    sentence = (
        f"From {round(low)} to {round(high)} degrees (95 % of frames) the line through the predictions is "
        f"off by {low_off:+.1f} degrees at the low end and {high_off:+.1f} at the high end; they scatter "
        f"around it by {scatter:.1f}."
    )
    return svg(draw, WIDTH, HEIGHT), sentence


def _slope(measured: np.ndarray, predicted: np.ndarray) -> float:
    centred = measured - measured.mean()
    square = float(centred @ centred)
    return float(centred @ predicted) / square if square > 0 else 1.0


def spectrum_of(spectrum: ErrorSpectrum, rotation: str) -> tuple[str, str]:
    """The error's spectrum with the plateau of its noise, and how much of it is slow."""
    frequency, density = spectrum.frequency_hz, spectrum.density

    def draw(axes: Axes) -> None:
        axes.axvspan(frequency[0], SLOW_HZ, color=QUIET, alpha=0.4, linewidth=0, label="slow")
        axes.plot(frequency, np.maximum(density, 1e-12), color=MODEL, linewidth=1.2)
        if spectrum.plateau_density > 0:
            axes.axhline(
                spectrum.plateau_density, color=FLOOR, linestyle="--", label="plateau of white noise"
            )
        axes.set(xscale="log", yscale="log", xlabel="hertz", ylabel="error, degrees² / hertz")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=12))
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axis.set_minor_formatter(NullFormatter())
        axes.legend(frameon=False, fontsize=8, loc="upper right")

    sentence = (
        f"{100 * spectrum.slow_share:.0f} % of the variance of {rotation}'s error is slower than "
        f"{SLOW_HZ:.0f} Hz (95 % interval {100 * spectrum.slow_low:.0f} to {100 * spectrum.slow_high:.0f}); "
        f"the plateau at high frequencies is white noise of {spectrum.plateau.floor_deg:.2f} degrees."
    )
    return svg(draw, WIDTH, HEIGHT), sentence


def error_by_wearing(item: WearingErrors) -> tuple[str, str]:
    """Mean error in each wearing."""

    def draw(axes: Axes) -> None:
        places = np.arange(len(item.wearings))
        axes.axhline(0, color=QUIET)
        axes.bar(places, item.mean_deg, color=MODEL, width=0.6)
        counts = zip(item.wearings, item.takes, strict=True)
        labels = [f"{name}\n{takes} take{'' if takes == 1 else 's'}" for name, takes in counts]
        many = len(labels) > 4
        axes.set_xticks(places, labels, rotation=60 if many else 0, ha="right" if many else "center")
        axes.set_ylabel(f"mean error of {item.rotation}, degrees")

    return svg(draw, WIDTH, HEIGHT), item.sentence
