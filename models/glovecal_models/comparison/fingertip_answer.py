"""Errors of fingertips in mm: what an answer holds of them, and how they are shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from glovecal_models.presentation.document import Chart, Column, Table, answer
from glovecal_models.presentation.drawing import FLOOR, MEASURED, MODEL, QUIET, legend_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ALL = "all"
TIP_SCALES = (
    "Distance in mm between the predicted and the measured fingertip, relative to the palm. floor: the "
    "joints' noise floors propagated to the tip as if independent, with 95 % intervals (>: a lower bound); "
    "spread: error when predicting the mean angles; thumb to index: error of the distance between these two "
    "tips."
)
View = Literal["from the back", "from the thumb's side"]
SEEN: dict[View, np.ndarray] = {
    "from the back": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]),
    "from the thumb's side": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
}
"""Each view's right and up, in the skeleton's frame; the fingers of a flat hand point up."""
SCALE_MM = 50.0


@answer
class FingertipFloor:
    """With the interval that the ends of the joints' 95 % intervals give."""

    floor_mm: float
    """The joints' noise floors, carried to the tip."""
    low_mm: float
    high_mm: float
    is_lower_bound: bool
    """That of some joint is one: autocorrelated noise is not included."""
    is_reliable: bool = True
    """That of every joint is."""

    def beside(self, rmse_mm: float) -> FingertipFloor:
        """The floor of an error of ``rmse_mm``, never above it."""
        ends = {name: min(getattr(self, name), rmse_mm) for name in ("floor_mm", "low_mm", "high_mm")}
        return replace(self, **ends, is_reliable=self.is_reliable and self.low_mm <= rmse_mm)

    @property
    def ends(self) -> tuple[float, float, float]:
        return self.floor_mm, self.low_mm, self.high_mm

    @property
    def text(self) -> str:
        return f">{self.floor_mm:.2f}" if self.is_lower_bound else f"{self.low_mm:.2f}-{self.high_mm:.2f}"


@answer
class TipErrors:
    """Distances between where a fingertip is predicted and where it was measured, in mm."""

    count: int
    """Frames; overall: frames times fingers."""
    rmse_mm: float
    percentile_95_mm: float
    """95 % of the distances are at or below this."""
    baseline_mm: float
    """Error when predicting each rotation's mean angle."""
    floor: FingertipFloor | None
    """How small the RMSE can get; null: unknown for some joint."""
    assumed_equal: Sequence[str]
    """Rotations of the chain that were not predicted and measured in all of these frames: there they are the
    same in both hands."""


HandLines = Sequence[Sequence[tuple[float, float, float]]]


@answer
class WorstTip:
    """The frame in which a fingertip is farthest off, and the two hands in it."""

    finger: str
    error_mm: float
    take: str
    time_s: float
    """Since the start of the take."""
    measured_deg: Mapping[str, float]
    """Every rotation of the hand in this frame."""
    predicted_deg: Mapping[str, float]
    measured_mm: HandLines = ()
    """The hand's bones, seen from the palm: palm to tip of each finger, then across the knuckles."""
    predicted_mm: HandLines = ()


@answer
class FingertipErrors:
    """Distances between predicted and measured fingertips, seen from the palm: the wrist does not count."""

    hand_length_mm: float
    is_assumed: bool
    """This subject's hand was not measured."""
    overall: TipErrors
    fingers: Mapping[str, TipErrors]
    """thumb to pinky, those whose chain was predicted and measured."""
    thumb_index: TipErrors | None
    """Of the distance between the tips of thumb and index finger; null where one of them does not count."""
    worst: WorstTip
    sentence: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "sentence", self._sentence())

    def _sentence(self) -> str:
        """For which hand, and what was assumed."""
        overall, fingers = self.overall, self.fingers
        hand = f"for a hand of {self.hand_length_mm:.0f} mm{', an assumed size' if self.is_assumed else ''}"
        scale = f"; when predicting the mean {overall.baseline_mm:.1f}"
        if overall.floor is not None:
            bound = "lower bound " if overall.floor.is_lower_bound else ""
            scale = f"; noise floor {bound}{overall.floor.floor_mm:.1f}"
        worst = max(fingers, key=lambda name: fingers[name].rmse_mm)
        sentence = f"Fingertip error {overall.rmse_mm:.1f} mm (RMSE, {hand}{scale})"
        if len(fingers) > 1:
            sentence += f", largest at the {worst} with {fingers[worst].rmse_mm:.1f} mm"
        if self.thumb_index is not None:
            sentence += f"; distance between thumb and index fingertip: {self.thumb_index.rmse_mm:.1f} mm"
        if equal := list(overall.assumed_equal):
            names = " and ".join(filter(None, (", ".join(equal[:-1]), equal[-1])))
            were = "was" if len(equal) == 1 else "were"
            sentence += f". {names} {were} not measured throughout and assumed equal"
        return f"{sentence}."

    @property
    def rows(self) -> dict[str, TipErrors]:
        rows = {ALL: self.overall, **self.fingers}
        return rows if self.thumb_index is None else {**rows, "thumb to index": self.thumb_index}

    def table(self) -> Table:
        columns = [
            Column("finger", "fingertip (mm)"), Column("rmse_mm", "RMSE"), Column("floor"),
            Column("percentile_95_mm", "95 %"), Column("baseline_mm", "spread"), Column("count", "frames"),
        ]  # fmt: skip
        rows = [
            (
                name, one.rmse_mm, None if one.floor is None else one.floor.text, one.percentile_95_mm,
                one.baseline_mm, one.count,
            )
            for name, one in self.rows.items()
        ]  # fmt: skip
        return Table(columns, rows, legend=TIP_SCALES)

    def chart(self) -> Chart:
        """Errors against their floors; beside them both hands in the worst frame."""
        worst = self.worst
        sentence = (
            f"Right: the frame with the largest error, take {worst.take} at {worst.time_s:.1f} s: "
            f"{worst.finger} by {worst.error_mm:.1f} mm."
        )
        return Chart(None, 9, 3.6, sentence, panels=self._draw)

    def _draw(self, page: Figure) -> None:
        views: Sequence[View] = get_args(View)
        bars, *hands = page.subplots(1, 1 + len(views), width_ratios=(1.5, 1, 1))
        rows = [
            Bar(name, one.rmse_mm, None if one.floor is None else one.floor.ends)
            for name, one in self.rows.items()
        ]
        draw_errors(bars, rows, "mm")
        for axes, view in zip(hands, views, strict=True):
            _draw_hand(axes, self.worst.measured_mm, view, MEASURED, "measured")
            _draw_hand(axes, self.worst.predicted_mm, view, MODEL, "predicted")
            axes.set_title(view)
            axes.plot([-SCALE_MM, 0.0], [-12.0, -12.0], color=QUIET, linewidth=3, solid_capstyle="butt")
            axes.text(-SCALE_MM / 2, -16.0, f"{SCALE_MM:.0f} mm", ha="center", va="top")
        hands[0].legend(loc="upper center", bbox_to_anchor=(0.5, -0.02), ncols=2)


@dataclass(frozen=True)
class Bar:
    """An error, and its floor with the ends of its interval."""

    name: str
    rmse: float
    floor: tuple[float, float, float] | None


def draw_errors(axes: Axes, bars: Sequence[Bar], unit: str) -> None:
    """A bar for each error, its noise floor marked; the first on top."""
    axes.barh(range(len(bars)), [one.rmse for one in bars], color=MODEL, label="error (RMSE)")
    known = [(row, one.floor) for row, one in enumerate(bars) if one.floor is not None]
    for number, (row, (floor, low, high)) in enumerate(known):
        label = "noise floor, 95 % interval" if number == 0 else None
        axes.plot([low, high], [row, row], color=FLOOR, linewidth=2)
        axes.plot(floor, row, "|", color=FLOOR, markersize=11, markeredgewidth=3, label=label)
    axes.set_yticks(range(len(bars)), [one.name for one in bars])
    axes.set_ylim(len(bars) - 0.4, -0.6)
    axes.set_xlabel(unit)
    axes.set_xlim(0, None)
    legend_above(axes, 2)


def _draw_hand(axes: Axes, lines: HandLines, view: View, colour: str, label: str) -> None:
    """The bones of one frame, in mm."""
    for number, line in enumerate(lines):
        right, up = SEEN[view] @ np.array(line).T
        axes.plot(
            right, up, color=colour, linewidth=1.2, marker="o", markersize=2.5, solid_capstyle="round",
            label=label if number == 0 else None,
        )  # fmt: skip
    axes.set_aspect("equal")
    axes.set_axis_off()
