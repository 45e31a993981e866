"""How the error falls: from no calibration over simpler ones through each effect down to the noise floor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from glovecal_models.presentation.document import (
    Answer,
    Chart,
    Column,
    Explanation,
    Fact,
    Presentation,
    Section,
    Table,
    TakeNamed,
    answer,
    first_of,
)
from glovecal_models.presentation.drawing import CONTROL, FLOOR, MODEL, QUIET, legend_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDE_RANGE = 15.0
"""From this ratio of the largest to the smallest error the axis is logarithmic."""


@answer
class FloorBand:
    """The noise floor over all rotations."""

    floor_deg: float
    low_deg: float
    """95 % interval."""
    high_deg: float

    @classmethod
    def of(cls, floors: Mapping[str, Sequence[float]]) -> FloorBand | None:
        """``floors``: for each rotation floor, low and high; None without any."""
        if not floors:
            return None
        return cls(
            *(float(np.sqrt(np.mean(np.square(column)))) for column in zip(*floors.values(), strict=True))
        )


@answer
class FallStep:
    """A calibration of the fall, and its error over all rotations."""

    label: str
    """What is new: a method, or effects with + and -."""
    rmse_deg: float
    control_rmse_deg: float | None = None
    """With the control of the newest effect in its place; null: not known."""
    is_scale: bool = False
    """A simpler calibration, there for scale."""
    model: str | None = None
    """The version's id; null: not stored."""
    effects: Sequence[str] = ()
    """All of the version."""


@answer
class ErrorFall(Answer):
    """How the error fell down to a model."""

    model: str
    steps: Sequence[FallStep]
    """Simpler calibrations, then the versions, oldest first."""
    floor: FloorBand | None
    """Over all rotations."""
    takes: Sequence[TakeNamed]
    """The errors are on these."""
    is_held_out: bool
    """Whether no version was trained on any of them; else each error is of folds held out of its training."""
    how: str = ""
    sentence: str = ""

    def __post_init__(self) -> None:
        how = (
            f"On takes that no version was trained on: {', '.join(take.name for take in self.takes)}."
            if self.is_held_out
            else "On whole takes held out of each training in turn."
        )
        object.__setattr__(self, "how", how)
        object.__setattr__(self, "sentence", fall_sentence(self.steps, self.floor))

    def presentation(self) -> Presentation:
        columns = [Column("step"), Column("rmse_deg", "error (°)"), Column("control_rmse_deg", "control (°)")]
        rows = [(item.label, item.rmse_deg, item.control_rmse_deg) for item in self.steps]
        named = first_of([take.name for take in self.takes])
        return Presentation(
            f"Fall of the error down to model {self.model[:12]}",
            [Fact("Verdict", self.sentence), Fact("Takes", named)],
            sections=[
                Section(
                    "How the error falls",
                    [fall_chart(self.steps, self.floor), Table(columns, rows), Explanation(self.how)],
                )
            ],
        )


def fall_sentence(falls: Sequence[FallStep], band: FloorBand | None) -> str:
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
    from glovecal_models.comparison.noise_floor import reaches_floor

    rest = (
        "the error is at the floor"
        if reaches_floor(last.rmse_deg, band.high_deg)
        else f"the error is {last.rmse_deg - band.floor_deg:.2f} degrees above it"
    )
    return f"{sentence}. The noise floor is {band.floor_deg:.2f}: {rest}."


def _inline(label: str) -> str:
    return label.replace("\n", " ")


def fall_chart(falls: Sequence[FallStep], band: FloorBand | None) -> Chart:
    """Bars from zero on a linear axis; a fall over decades is drawn as dots on a logarithmic one."""
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
        axes.set(xlabel="calibration", ylabel="error (RMSE), degrees")
        if is_wide:
            _draw_dots(axes, errors, colours, smallest)
        else:
            bars = axes.bar(places, errors, color=colours, width=0.62)
            axes.bar_label(bars, [_short(error) for error in errors], padding=3)
            axes.set_ylim(0, 1.12 * max([*errors, *(item.control_rmse_deg or 0.0 for item in falls)]))
        if axes.get_legend_handles_labels()[0]:
            legend_above(axes)

    return Chart(draw, max(5.5, 1.5 + 1.25 * len(falls)), 3.6, fall_sentence(falls, band))


def _draw_dots(axes: Axes, errors: Sequence[float], colours: Sequence[str], smallest: float) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.scatter(range(len(errors)), errors, s=70, color=colours, zorder=3)
    for place, error in enumerate(errors):
        axes.annotate(_short(error), (place, error), (0, 8), textcoords="offset points", ha="center")
    axes.set(yscale="log", ylim=(0.6 * smallest, 2.0 * max(errors)), xlim=(-0.6, len(errors) - 0.4))
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=12))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _draw_controls(axes: Axes, falls: Sequence[FallStep]) -> None:
    known = [(place, item.control_rmse_deg) for place, item in enumerate(falls) if item.control_rmse_deg]
    for number, (place, error) in enumerate(known):
        axes.hlines(
            error, place - 0.42, place + 0.42, color=CONTROL, linestyle="--", zorder=4,
            label="control in the effect's place" if number == 0 else "",
        )  # fmt: skip


def _short(error: float) -> str:
    return f"{error:.2f}" if error < 10 else f"{error:.1f}"
