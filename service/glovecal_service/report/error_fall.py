"""How the error falls: from no calibration over simpler ones through each effect down to the noise floor.

Bars from zero on a linear axis; a fall over decades is drawn as dots on a logarithmic one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.comparison.compare import RotationErrors
from glovecal_models.comparison.noise_floor import reaches_floor
from glovecal_models.comparison.residuals import Residuals, residuals
from glovecal_models.takes.take import Take
from glovecal_service.report.drawing import CONTROL, FLOOR, MODEL, QUIET, legend_above, svg
from glovecal_service.views.renamed_keys import current

WIDE_RANGE = 15.0
"""From this ratio of the largest to the smallest error the axis is logarithmic."""


@dataclass(frozen=True)
class Fall:
    """A calibration and its error over all rotations."""

    label: str
    rmse_deg: float
    control_rmse_deg: float | None = None
    """The error with the newest effect's control in its place."""
    is_scale: bool = False
    """A simpler calibration, there for scale."""


@dataclass(frozen=True)
class FloorBand:
    """The noise floor over all rotations, 95 % interval."""

    floor_deg: float
    low_deg: float
    high_deg: float

    @classmethod
    def of(cls, floors: Mapping[str, Sequence[float]]) -> FloorBand | None:
        """``floors``: for each rotation floor, low and high; None without any."""
        if not floors:
            return None
        return cls(
            *(float(np.sqrt(np.mean(np.square(column)))) for column in zip(*floors.values(), strict=True))
        )


def error_fall(falls: Sequence[Fall], band: FloorBand | None) -> tuple[str, str]:
    """The picture, and what it shows."""
    errors = [item.rmse_deg for item in falls]
    smallest = min(errors) if band is None else min(*errors, band.low_deg)
    is_wide = max(errors) > WIDE_RANGE * max(smallest, 1e-9) and smallest > 0

    def draw(axes: Axes) -> None:
        places = np.arange(len(falls))
        if band is not None:
            axes.axhspan(
                band.low_deg, band.high_deg, color=FLOOR, alpha=0.35, label="noise floor, 95 % interval"
            )
            axes.axhline(band.floor_deg, color=FLOOR, linewidth=1)
        _draw_controls(axes, falls)
        colours = [QUIET if item.is_scale else MODEL for item in falls]
        axes.set_xticks(places, [item.label for item in falls])
        axes.set_ylabel("error (RMSE), degrees")
        if is_wide:
            axes.scatter(places, errors, s=70, color=colours, zorder=3)
            for place, error in zip(places, errors, strict=True):
                axes.annotate(_short(error), (place, error), (0, 8), textcoords="offset points", ha="center")
            axes.set(yscale="log", ylim=(0.6 * smallest, 2.0 * max(errors)), xlim=(-0.6, len(falls) - 0.4))
            axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=12))
            axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axes.yaxis.set_minor_formatter(NullFormatter())
        else:
            bars = axes.bar(places, errors, color=colours, width=0.62)
            axes.bar_label(bars, [_short(error) for error in errors], padding=3)
            axes.set_ylim(0, 1.12 * max([*errors, *(item.control_rmse_deg or 0.0 for item in falls)]))
        if axes.get_legend_handles_labels()[0]:
            legend_above(axes)

    return svg(draw, max(5.5, 1.5 + 1.25 * len(falls)), 3.6), fall_sentence(falls, band)


def _draw_controls(axes: Axes, falls: Sequence[Fall]) -> None:
    known = [(place, item.control_rmse_deg) for place, item in enumerate(falls) if item.control_rmse_deg]
    for number, (place, error) in enumerate(known):
        axes.hlines(
            error, place - 0.42, place + 0.42, color=CONTROL, linestyle="--", zorder=4,
            label="control in the effect's place" if number == 0 else "",
        )  # fmt: skip


def fall_sentence(falls: Sequence[Fall], band: FloorBand | None) -> str:
    """From where to where, against control and floor."""
    base = next((item for item in falls if not item.is_scale), falls[0])
    last = falls[-1]
    scale = [f"{item.rmse_deg:.2f} for {item.label}" for item in falls if item.is_scale]
    beside = f" ({', '.join(scale)})" if scale else ""
    if last is base:
        sentence = (
            f"The error of {_inline(base.label)} alone is {base.rmse_deg:.2f} degrees{beside}; no effect was "
            "added"
        )
    else:
        added = ", ".join(_inline(item.label) for item in falls[falls.index(base) + 1 :])
        verb = "falls" if last.rmse_deg < base.rmse_deg else "changes"
        sentence = (
            f"The error {verb} from {base.rmse_deg:.2f} degrees with {_inline(base.label)}{beside} to "
            f"{last.rmse_deg:.2f} with {added.replace('+ ', '')}"
        )
        if last.control_rmse_deg is not None:
            sentence += f" (control of the last effect: {last.control_rmse_deg:.2f})"
    if band is None:
        return f"{sentence}. The noise floor of these takes is unknown."
    reached = reaches_floor(last.rmse_deg, band.high_deg)
    rest = (
        "the error is at the floor"
        if reached
        else f"the error is {last.rmse_deg - band.floor_deg:.2f} degrees above it"
    )
    return f"{sentence}. The noise floor is {band.floor_deg:.2f}: {rest}."


def _short(error: float) -> str:
    return f"{error:.2f}" if error < 10 else f"{error:.1f}"


def _inline(label: str) -> str:
    return label.replace("\n", " ")


def lineage_fall(
    line: Sequence[CalibrationModel],
    scale: Mapping[str, CalibrationModel],
    takes: Sequence[Take],
    overall: RotationErrors,
) -> tuple[str, str]:
    """``line``: the versions, oldest first; ``scale``: simpler calibrations by name.

    ``overall`` are the newest one's errors. Raises LayoutMismatch, BadInput as residuals do.
    """
    falls = [Fall(name, _rmse_deg(residuals(model, takes)), is_scale=True) for name, model in scale.items()]
    falls.sort(key=lambda item: -item.rmse_deg)
    before: CalibrationModel | None = None
    found: Residuals | None = None
    for model in line:
        earlier, found = found, residuals(model, takes)
        control = None if before is None or earlier is None else _with_control(model, before, earlier)
        falls.append(Fall(_version_label(model, before), _rmse_deg(found), control))
        before = model
    floor = overall.floor
    band = None if floor is None else FloorBand(floor.floor_deg, floor.low_deg, floor.high_deg)
    return error_fall(falls, band)


def _rmse_deg(found: Residuals) -> float:
    return float(np.sqrt(np.nanmean(found.stacked("error") ** 2)))


def _with_control(model: CalibrationModel, before: CalibrationModel, earlier: Residuals) -> float | None:
    """The error over all rotations with the newest effect's control instead, from the share it left when the
    effect was added; None where that is not known. ``earlier`` are the residuals without the effect.
    """
    had = {item.name for item in before.effects}
    evidence = {item.name: current(dict(item.evidence)) for item in model.effects if item.name not in had}
    gained = [item for item in model.effects if "rmse_control_deg" in evidence.get(item.name, ())]
    if not gained:
        return None
    square = earlier.stacked("error") ** 2
    for item in gained:
        known = evidence[item.name]
        share = known["rmse_control_deg"] / max(known["rmse_before_deg"], 1e-12)
        for name in set(item.active) & set(earlier.rotations):
            square[:, earlier.column(name)] *= min(share, 1.0) ** 2
    return float(np.sqrt(np.nanmean(square)))


def _version_label(model: CalibrationModel, before: CalibrationModel | None) -> str:
    """What is new in a version."""
    if before is None or model.method != before.method:
        return model.method
    now, earlier = ([item.name for item in one.effects] for one in (model, before))
    gained = [name for name in dict.fromkeys(now) if name not in earlier]
    lost = [name for name in dict.fromkeys(earlier) if name not in now]
    if not gained and not lost:
        return f"{model.method}\nretrained"
    return "\n".join([*(f"+ {name}" for name in gained), *(f"- {name}" for name in lost)])
