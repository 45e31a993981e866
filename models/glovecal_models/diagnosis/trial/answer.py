"""What effects would save of a model's held-out error, each beside its control."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from glovecal_models.diagnosis.residual_answer import explained
from glovecal_models.presentation.document import Chart, Column, Part, Table, answer
from glovecal_models.presentation.drawing import CONTROL, HEAT, MODEL, QUIET, draw_heat, legend_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CANDIDATES_PRINTED = 6
SCALE = (
    "Errors of what the sensors read, in degrees, on held-out takes, readings and reference identically "
    "smoothed; not the model's error of angles. A control has the same freedom as its effect and cannot be "
    "right: what it saves is flexibility, not cause. Noise floors are of errors that are not smoothed."
)


@answer
class Candidate:
    """An effect that was tried, beside its control."""

    effect: str
    where: Sequence[str]
    """Rotations on which it beats its control significantly."""
    rmse_before_deg: float | None
    """Smoothed error on held-out takes without it."""
    rmse_after_deg: float | None
    """With it."""
    rmse_control_deg: float | None
    """With its control instead."""
    saved_share: Mapping[str, float | None]
    """Of the squared error, for each rotation."""
    control_saved_share: Mapping[str, float | None]
    """The same of its control."""
    p_value: float | None
    """By permuting takes; null: tested block by block."""
    passes: bool
    """Whether it is significant on any rotation."""
    sentence: str = ""

    @property
    def saved_deg(self) -> float:
        return self._saved(self.rmse_after_deg)

    @property
    def control_saved_deg(self) -> float:
        return self._saved(self.rmse_control_deg)

    def _saved(self, left_deg: float | None) -> float:
        """0 where either error is unknown."""
        before = self.rmse_before_deg
        return 0.0 if before is None or left_deg is None else before - left_deg

    def beyond_control(self, rotation: str) -> float:
        """Share of the squared error that it saves there and its control does not."""
        own, of_control = (item.get(rotation) or 0.0 for item in (self.saved_share, self.control_saved_share))
        return max(own - max(of_control, 0.0), 0.0)

    @property
    def size(self) -> str:
        before, after, control = (
            value or 0.0 for value in (self.rmse_before_deg, self.rmse_after_deg, self.rmse_control_deg)
        )
        return f"explains {explained(before, after, control, self.p_value)}"

    @property
    def clearest_rotation(self) -> str | None:
        """Where it saves the largest share; None: unknown."""
        shares = self.saved_share
        return max(shares, key=lambda name: shares[name] or 0.0) if shares else None


@answer
class TriedEffect:
    """What one effect would save of a model's held-out error."""

    model: str
    effect: str
    explanation: str
    takes: Sequence[str]
    """Their ids; each is left out once."""
    judged: Candidate | None
    """Null: these takes cannot show it."""
    not_identifiable: str | None
    """Why these takes cannot show it."""


def tried_parts(candidates: Sequence[Candidate]) -> list[Part]:
    """Savings beside those of controls, by rotation, and as numbers; ``candidates``: the best first."""
    columns = [
        Column("effect"), Column("rotations", "where", folds=True), Column("rmse_deg", "error before"),
        Column("with_effect_rmse_deg", "with the effect"),
        Column("with_control_rmse_deg", "with its control"), Column("p_value", "p", 3),
        Column("significant"),
    ]  # fmt: skip
    rows = [
        (
            item.effect, ", ".join(item.where) or None, item.rmse_before_deg, item.rmse_after_deg,
            item.rmse_control_deg, item.p_value, item.passes,
        )
        for item in candidates
    ]  # fmt: skip
    printed = max(CANDIDATES_PRINTED, sum(item.passes for item in candidates))
    bars = Chart(partial(_draw_saved, candidates), 9, 1.5 + 0.34 * len(rows), _saved_sentence(candidates))
    heat = _heat_map(candidates)
    return [bars, *([] if heat is None else [heat]), Table(columns, rows, SCALE, printed=printed)]


def _draw_saved(candidates: Sequence[Candidate], axes: Axes) -> None:
    """Degrees by which each effect reduces the error, its control's below. Blue is significant."""
    shown = candidates[::-1]
    rows = np.arange(len(shown))
    colours = [MODEL if item.passes else QUIET for item in shown]
    axes.barh(rows + 0.2, [item.saved_deg for item in shown], height=0.38, color=colours)
    of_controls = [item.control_saved_deg for item in shown]
    axes.barh(rows - 0.2, of_controls, height=0.38, color=CONTROL, alpha=0.7)
    axes.barh([0], [0], color=MODEL, label="effect, significant")
    axes.barh([0], [0], color=QUIET, label="effect, not significant")
    axes.barh([0], [0], color=CONTROL, alpha=0.7, label="its control")
    axes.axvline(0, color=QUIET, linewidth=0.8)
    axes.set_yticks(rows, [item.effect for item in shown])
    axes.set_xlabel("error of the sensors reduced by, degrees, on held-out takes")
    legend_above(axes)


def _saved_sentence(candidates: Sequence[Candidate]) -> str:
    significant = [item for item in candidates if item.passes]
    tried = f"{len(candidates)} effects were tried"
    if not significant:
        return f"{tried}; none beats its control significantly."
    first, *others = significant
    rest = f"; also significant: {', '.join(item.effect for item in others)}" if others else ""
    return (
        f"{tried}. {first.effect} reduces the error of the sensors by {first.saved_deg:.2f} degrees "
        f"(control: {first.control_saved_deg:.2f}){rest}."
    )


def _heat_map(candidates: Sequence[Candidate]) -> Chart | None:
    """Effects by rotations: share of the squared error saved beyond the control; None without shares."""
    shown = [item for item in candidates if item.saved_share]
    rotations = list(dict.fromkeys(name for item in shown for name in item.saved_share))
    if not rotations:
        return None
    values = np.array([[item.beyond_control(name) for name in rotations] for item in shown])
    significant = np.array([[name in item.where for name in rotations] for item in shown])

    def draw(axes: Axes) -> None:
        draw_heat(axes, 100 * values, significant, 100, "% of squared error")
        axes.set_xticks(range(len(rotations)), rotations, rotation=60, ha="right")
        axes.set_yticks(range(len(shown)), [item.effect for item in shown])

    of_significant = np.where(significant, values, 0.0)
    row, column = np.unravel_index(int(np.argmax(of_significant)), values.shape)
    largest = (
        f"The largest: {shown[row].effect} on {rotations[column]}, {100 * values[row, column]:.0f} % of "
        "the squared error."
        if of_significant[row, column] > 0
        else "No effect is significant on any rotation."
    )
    sentence = f"What each effect saves beyond its control. {HEAT} {largest}"
    return Chart(draw, 3.6 + 0.36 * len(rotations), 1.6 + 0.27 * len(shown), sentence)
