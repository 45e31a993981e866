"""How well a session tells what is left out of it: each widget between others, and each touch, one at a time.

The only true errors that a session without a reference system has. They are those of its calibration as it is
believed (``rotation_posterior.py``, ``touch_posterior.py``); the regressor trained on it follows it closely.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.layout import Layout
from glovecal_models.progress import Cancel, stop_if
from glovecal_models.sampling.guided.labelled_takes import LabelledFrames, Moved
from glovecal_models.sampling.guided.rotation_posterior import Ranges, first_posteriors
from glovecal_models.sampling.guided.seen_touches import SeenTouch
from glovecal_models.sampling.guided.touch_posterior import TouchPosterior

FEWEST = 3
"""Angles of a rotation, or touches, without which leaving one out leaves too little."""
FRAMES_A_TOUCH = 40


@dataclass(frozen=True)
class HeldOutErrors:
    widget_rmse_deg: dict[str, float]
    """By rotation: of frames with a widget that was left out, over its widgets but the first and the last,
    without which nothing would tell the ends of the range."""
    touch_mm: dict[str, float]
    """By touch: how far apart its tips are (median) in a calibration that knows only the others."""

    @property
    def rmse_deg(self) -> float | None:
        errors = np.array(list(self.widget_rmse_deg.values()))
        return float(np.sqrt(np.mean(errors**2))) if len(errors) else None

    def sentences(self) -> list[str]:
        said = []
        if self.rmse_deg is not None:
            worst = max(self.widget_rmse_deg, key=lambda name: self.widget_rmse_deg[name])
            said.append(
                f"Widgets left out, one at a time, are read {self.rmse_deg:.1f} degrees off (RMSE over the "
                f"inner ones of {len(self.widget_rmse_deg)} rotations; worst is {worst}, "
                f"{self.widget_rmse_deg[worst]:.1f})."
            )
        if self.touch_mm:
            each = ", ".join(f"{name} {gap:.1f}" for name, gap in self.touch_mm.items())
            said.append(f"Touches left out, one at a time, miss by (mm, median): {each}.")
        return said


def held_out_errors(
    layout: Layout,
    samples: LabelledFrames,
    ranges: Ranges,
    skeleton: Skeleton | None,
    seen: Sequence[SeenTouch],
    whole: TouchPosterior,
    cancelled: Cancel | None = None,
) -> HeldOutErrors:
    """Nothing of what has fewer than ``FEWEST`` to choose from. Raises Cancelled."""
    widgets = {}
    for rotation in samples.rotations:
        angles = np.unique(samples.of_widgets(rotation, ())[1])
        if len(angles) >= FEWEST:
            errors = [_of_widget(layout, samples, ranges, rotation, angle) for angle in angles[1:-1].tolist()]
            widgets[rotation] = float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
        stop_if(cancelled, "leaving out widgets")
    return HeldOutErrors(widgets, _of_touches(layout, skeleton, seen, whole, cancelled))


def _of_widget(
    layout: Layout, samples: LabelledFrames, ranges: Ranges, rotation: str, angle: float
) -> np.ndarray:
    """Errors (N,) of the frames with the widget of ``angle`` in a posterior from all others, degrees."""
    sensors = layout.correspondence(rotation).sensors
    readings, angles = samples.of_widgets(rotation, sensors)
    others = replace(samples, moved=tuple(_without(moved, rotation, angle) for moved in samples.moved))
    process = first_posteriors(layout, others, ranges, only=[rotation])[rotation]
    return process.mean(readings[angles == angle]) - angle


def _without(moved: Moved, rotation: str, angle: float) -> Moved:
    if rotation not in moved.take.rotations:
        return moved
    reference = moved.take.reference.copy()
    column = reference[:, moved.take.rotations.index(rotation)]
    column[column == angle] = np.nan
    return replace(moved, take=replace(moved.take, reference=reference))


def _of_touches(
    layout: Layout,
    skeleton: Skeleton | None,
    seen: Sequence[SeenTouch],
    whole: TouchPosterior,
    cancelled: Cancel | None,
) -> dict[str, float]:
    if skeleton is None or len(seen) < FEWEST:
        return {}
    found = {}
    for touch in seen:
        others = [other.some(FRAMES_A_TOUCH) for other in seen if other is not touch]
        posterior = TouchPosterior(whole.priors, layout.sensors, skeleton, others, cancelled)
        found[touch.pose] = float(np.median(posterior.apart_mm(touch.some(FRAMES_A_TOUCH), skeleton)))
    return found
