"""Where a model fails."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from glovecal._calls import library_call
from glovecal._model import CalibrationModel, inner_model
from glovecal._plotting import FLOOR, MODEL, axes_for, finished
from glovecal._shown import Shown
from glovecal._table import Column, Table
from glovecal._takes import takes_in
from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_models.takes.take import Take

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from glovecal_models.comparison.dependence import Dependence
    from glovecal_models.comparison.where_it_fails import RotationFindings
    from glovecal_models.comparison.where_it_fails import WhereItFails as InnerWhere

COLUMNS = (
    Column("rotation"), Column("rmse_deg"), Column("noise_floor_deg"), Column("bias_deg"),
    Column("depends_on"), Column("explained_deg"), Column("p_value", 3), Column("significant"),
)  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class WhereItFails(Shown):
    """What each rotation's error depends on, the rotation farthest above its noise floor first."""

    inner: InnerWhere
    """``glovecal_models.comparison.where_it_fails.WhereItFails``: every column tested, wearings, floors."""

    @property
    def rotations(self) -> tuple[str, ...]:
        """The one with the largest possible improvement first."""
        return tuple(item.rotation for item in self.inner.rotations)

    @property
    def sentences(self) -> tuple[str, ...]:
        """One for each rotation."""
        from glovecal_models.comparison.text import rotation_sentence

        return tuple(rotation_sentence(item) for item in self.inner.rotations)

    def depends_on(self, rotation: str) -> tuple[str, ...]:
        """Columns on which the rotation's error depends significantly, the strongest first."""
        return tuple(item.covariate for item in self._findings(rotation).structure)

    def table(self) -> Table:
        """One row for each rotation, with the column that explains most."""
        rows = []
        for item in self.inner.rotations:
            floor = None if item.floor is None else item.floor.floor_deg
            first = next(iter(item.structure), None) or next(iter(item.dependences), None)
            explained = (
                (None, None, None, False)
                if first is None
                else (first.covariate, first.explained_deg, first.p_value, first in item.structure)
            )
            rows.append((item.rotation, item.rmse_deg, floor, item.bias_deg, *explained))
        return Table.of(COLUMNS, rows, after=self.sentences)

    def plot(self, rotation: str | None = None, column: str | None = None, *, ax: Axes | None = None) -> Axes:
        """Mean error of a rotation against a column, with what chance does to it (95 %); gives the axes back.

        Default: the first rotation, and the column that explains most of its error. Raises BadInput for a
        rotation or column that was not tested.
        """
        if rotation is None and not self.inner.rotations:
            raise BadInput("no rotation was measured, so there is nothing to draw")
        found = self._findings(rotation or self.inner.rotations[0].rotation)
        item = _dependence(found, column)
        axes = axes_for(ax)
        middle = (item.edges[1:] + item.edges[:-1]) / 2
        mean = float(np.average(item.mean_deg, weights=item.count))
        axes.fill_between(
            middle, mean - item.chance_deg, mean + item.chance_deg, color=FLOOR, alpha=0.3,
            label="95 % of circular shifts",
        )  # fmt: skip
        axes.plot(middle, item.mean_deg, "o-", color=MODEL, label=f"mean error (p = {item.p_value:.3f})")
        axes.axhline(0.0, color="black", linewidth=0.6)
        axes.set_xlabel(f"{item.covariate} ({item.unit})" if item.unit else item.covariate)
        axes.set_ylabel(f"error of {found.rotation} (degrees)")
        return finished(axes)

    def _findings(self, rotation: str) -> RotationFindings:
        for item in self.inner.rotations:
            if item.rotation == rotation:
                return item
        raise BadInput(f"no rotation {rotation!r} was measured; {did_you_mean(rotation, self.rotations)}")


def _dependence(found: RotationFindings, column: str | None) -> Dependence:
    tested = [*found.structure, *found.dependences]
    for item in tested:
        if column is None or item.covariate == column:
            return item
    there = ", ".join(item.covariate for item in found.dependences) or "none"
    asked = "no column" if column is None else f"column {column!r} was not"
    raise BadInput(f"{found.rotation}: {asked} tested; there are {there}")


def where(model: CalibrationModel, takes: Take | Iterable[Take], *, seed: int = 0) -> WhereItFails:
    """Hold each rotation's error against its noise floor and every recorded column.

    A column is significant only if circularly shifted errors do not depend on it as much; ``seed`` is of the
    shifts. Raises BadInput when nothing was measured, or when the takes are of another layout.
    """
    from glovecal_models.comparison.residuals import residuals
    from glovecal_models.comparison.where_it_fails import where_it_fails

    with library_call():
        return WhereItFails(where_it_fails(residuals(inner_model(model), takes_in(takes)), seed=seed))
