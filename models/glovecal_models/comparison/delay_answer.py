"""What a delay would buy: errors of angles that wait for the frames after them, and their curve."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from glovecal_models.presentation.document import answer
from glovecal_models.presentation.drawing import QUIET, SEVERAL, legend_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DELAYS_MS = (0, 50, 100, 200)


@answer
class DelayedError:
    """Of angles that are estimated with the frames up to a delay after them."""

    delay_ms: int
    rmse_deg: float


def draw_delay_curves(axes: Axes, curves: Mapping[str, Sequence[float]], label: str) -> None:
    """Each curve by its name: live, each of ``DELAYS_MS``, offline."""
    names = ["live", *(f"{delay} ms" for delay in DELAYS_MS), "offline"]
    for colour, (name, values) in zip(SEVERAL, curves.items(), strict=False):
        axes.plot(range(len(names)), values, "o-", color=colour, label=name)
    axes.set_xticks(range(len(names)), names)
    axes.grid(axis="y", color=QUIET, alpha=0.4, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.set(xlabel="delay of a pose", ylabel=label, ylim=(0, None))
    if len(curves) > 1:
        legend_above(axes)
