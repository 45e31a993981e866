"""What a delay would buy: the error of angles that wait for the frames after them, from live to offline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.offline import OfflinePredictor
from glovecal_models.comparison.residuals import Residuals
from glovecal_models.presentation.document import answer
from glovecal_models.presentation.drawing import QUIET, legend_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DELAYS_MS = (0, 50, 100, 200)
COLOURS = ("#1d6cab", "#c2453d", "#3f9c6b", "#a8790f", "#8d5fa8", "#17a2a8", "#6b6b6b")


@answer
class DelayedError:
    """Of angles that are estimated with the frames up to a delay after them."""

    delay_ms: int
    rmse_deg: float


def delay_errors(model: CalibrationModel, found: Residuals) -> tuple[DelayedError, ...]:
    """Of the takes of ``found``, all rotations together, for each of ``DELAYS_MS``."""
    predictor, squares = OfflinePredictor(model), [np.empty(0) for _ in DELAYS_MS]
    for item in found.takes:
        take = item.take
        index = [take.sensors.index(name) for name in model.layout.sensors]
        each = predictor.predict_delayed(
            take.time_s, take.readings[:, index], take.context, take.wearing, np.array(DELAYS_MS) / 1000
        )
        for number, angles in enumerate(each):
            error = angles.mean - item.measured
            squares[number] = np.append(squares[number], error[np.isfinite(error)] ** 2)
    return tuple(
        DelayedError(delay, float(np.sqrt(square.mean())))
        for delay, square in zip(DELAYS_MS, squares, strict=True)
    )


def draw_delay_curves(axes: Axes, curves: Mapping[str, Sequence[float]], label: str) -> None:
    """Each curve by its name: live, each of ``DELAYS_MS``, offline."""
    names = ["live", *(f"{delay} ms" for delay in DELAYS_MS), "offline"]
    for colour, (name, values) in zip(COLOURS, curves.items(), strict=False):
        axes.plot(range(len(names)), values, "o-", color=colour, label=name)
    axes.set_xticks(range(len(names)), names)
    axes.grid(axis="y", color=QUIET, alpha=0.4, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.set(xlabel="delay of a pose", ylabel=label, ylim=(0, None))
    if len(curves) > 1:
        legend_above(axes)
