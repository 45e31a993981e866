"""How the error falls: from no calibration over simpler ones through each effect down to the noise floor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from glovecal_models.comparison.at_floor import reaches_floor
from glovecal_service.report.drawing import DECOY, FLOOR, MODEL, QUIET, svg

WIDE_RANGE = 15.0
"""From this ratio of the largest to the smallest error the axis is logarithmic."""


@dataclass(frozen=True)
class Fall:
    """One bar: a calibration and its error over all rotations."""

    label: str
    rmse_deg: float
    decoy_rmse_deg: float | None = None
    """The error with the newest effect's decoy in its place."""
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
        colours = [QUIET if item.is_scale else MODEL for item in falls]
        bars = axes.bar(places, errors, color=colours, width=0.62)
        axes.bar_label(bars, [_short(error) for error in errors], padding=3)
        with_decoy = [(place, item) for place, item in zip(places, falls, strict=True) if item.decoy_rmse_deg]
        for number, (place, item) in enumerate(with_decoy):
            axes.hlines(
                item.decoy_rmse_deg or 0.0, place - 0.42, place + 0.42, color=DECOY, linestyle="--",
                label="with the effect's decoy instead" if number == 0 else "",
            )  # fmt: skip
        axes.set_xticks(places, [item.label for item in falls])
        axes.set_ylabel("error (RMSE), degrees")
        if is_wide:
            axes.set_yscale("log")
            axes.set_ylim(0.6 * smallest, 1.6 * max(errors))
        else:
            axes.set_ylim(0, 1.12 * max([*errors, *(item.decoy_rmse_deg or 0.0 for item in falls)]))
        if band is not None or with_decoy:
            axes.legend(frameon=False, loc="upper right")

    return svg(draw, max(5.5, 1.5 + 1.25 * len(falls)), 3.6), fall_sentence(falls, band)


def fall_sentence(falls: Sequence[Fall], band: FloorBand | None) -> str:
    """From where to where, against decoy and floor."""
    base = next((item for item in falls if not item.is_scale), falls[0])
    last = falls[-1]
    scale = [f"{item.rmse_deg:.2f} for {item.label}" for item in falls if item.is_scale]
    beside = f" ({', '.join(scale)})" if scale else ""
    if last is base:
        told = (
            f"The error of {_inline(base.label)} alone is {base.rmse_deg:.2f} degrees{beside}; no effect was "
            "added"
        )
    else:
        added = ", ".join(_inline(item.label) for item in falls[falls.index(base) + 1 :])
        verb = "falls" if last.rmse_deg < base.rmse_deg else "goes"
        told = (
            f"The error {verb} from {base.rmse_deg:.2f} degrees with {_inline(base.label)}{beside} to "
            f"{last.rmse_deg:.2f} with {added.replace('+ ', '')}"
        )
        if last.decoy_rmse_deg is not None:
            told += f"; the last effect's decoy would leave {last.decoy_rmse_deg:.2f}"
    if band is None:
        return f"{told}. How small it can get on these takes is not known."
    reached = reaches_floor(last.rmse_deg, band.high_deg)
    rest = "it is reached" if reached else f"{last.rmse_deg - band.floor_deg:.2f} degrees are left above it"
    return f"{told}. The noise floor is {band.floor_deg:.2f}: {rest}."


def _short(error: float) -> str:
    return f"{error:.2f}" if error < 10 else f"{error:.1f}"


def _inline(label: str) -> str:
    return label.replace("\n", " ")
