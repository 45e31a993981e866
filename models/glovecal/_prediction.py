"""Angles from readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from glovecal._calls import library_call
from glovecal._model import CalibrationModel, inner_model
from glovecal._shown import Shown
from glovecal._table import Cell, Column, Table
from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_models.presentation.document import Chart
from glovecal_models.presentation.drawing import legend_above, plotted
from glovecal_models.takes.take import Take

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from glovecal_models.calibration.predictor import GloveAngles


@dataclass(frozen=True, eq=False, repr=False)
class Angles(Shown):
    """Rotations of N frames, each with a standard deviation."""

    rotations: tuple[str, ...]
    """Names of the R rotations."""
    time_s: np.ndarray
    """(N,), seconds; the number of the frame where only readings were given."""
    inner: GloveAngles
    """``glovecal_models.calibration.predictor.GloveAngles``."""

    @property
    def mean_deg(self) -> np.ndarray:
        """(N, R), degrees."""
        return self.inner.mean

    @property
    def sd_deg(self) -> np.ndarray:
        """(N, R), degrees: standard deviation of a measurement of the rotation, noise included."""
        return self.inner.sd

    @property
    def flags(self) -> np.ndarray:
        """(N, R), sum of 1 extrapolating, 2 too uncertain to use, 4 by the layout's rule, 8 faulty sensor."""
        return self.inner.flags

    def table(self) -> Table:
        """One row for each frame; for each rotation its angle, then for each its standard deviation."""
        angles = [Column(f"{name}_deg") for name in self.rotations]
        spreads = [Column(f"{name}_sd_deg") for name in self.rotations]
        values = np.column_stack([self.time_s, self.mean_deg, self.sd_deg])
        rows: list[list[Cell]] = values.tolist()
        return Table.of([Column("time_s", 3), *angles, *spreads], rows)

    def plot(self, rotations: Sequence[str] | None = None, *, ax: Axes | None = None) -> Axes:
        """Angles over time with one standard deviation; gives the axes back. Raises BadInput for a name that
        is not predicted."""
        chosen = self.rotations if rotations is None else tuple(rotations)
        unknown = [name for name in chosen if name not in self.rotations]
        if unknown:
            meant = did_you_mean(unknown[0], self.rotations)
            raise BadInput(f"no rotation {unknown[0]!r} was predicted; {meant}")

        def draw(axes: Axes) -> None:
            for name in chosen:
                mean, sd = (item[:, self.rotations.index(name)] for item in (self.mean_deg, self.sd_deg))
                (line,) = axes.plot(self.time_s, mean, linewidth=1.0, label=name)
                axes.fill_between(self.time_s, mean - sd, mean + sd, color=line.get_color(), alpha=0.2)
            axes.set(xlabel="time (s)", ylabel="angle (degrees)")
            legend_above(axes, 4)

        return plotted(Chart(draw, 7.0, 3.3, "Angles over time."), ax)


def predict(model: CalibrationModel, readings: Take | np.ndarray, *, offline: bool = False) -> Angles:
    """Angles of a take, effects with a memory started at its first frame; or of readings alone, (N, S) in the
    order of the layout's sensors, without effects.

    ``offline``: a take is estimated with both directions of time, not as it was live. Raises BadInput on a
    wrong shape, on readings that are not finite, and when the take lacks a sensor.
    """
    from glovecal_models.calibration.offline import OfflinePredictor
    from glovecal_models.calibration.predictor import GlovePredictor
    from glovecal_models.calibration.samples import require_layout

    inner = inner_model(model)
    with library_call():
        predictor = OfflinePredictor(inner) if offline else GlovePredictor(inner)
        if not isinstance(readings, Take):
            found = predictor.predict(np.asarray(readings))
            return Angles(predictor.rotations, np.arange(len(found.mean), dtype=float), found)
        take = readings
        require_layout(take, inner.layout)
        columns = [take.sensors.index(name) for name in inner.layout.sensors]
        found = predictor.predict_take(take.time_s, take.readings[:, columns], take.context, take.wearing)
    return Angles(predictor.rotations, take.time_s, found)
