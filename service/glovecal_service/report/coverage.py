"""Which angles and readings training takes covered, and which ends of a joint's range they did not reach."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.presentation.document import (
    Chart,
    Column,
    Explanation,
    Lines,
    Part,
    Table,
    answer,
    counted,
)
from glovecal_models.presentation.drawing import MODEL, QUIET, legend_above
from glovecal_models.takes.take import Take

if TYPE_CHECKING:
    from matplotlib.axes import Axes

UNSEEN_DEG = 15.0
"""So much of a joint's active range may be missing at one end before it is said."""
HOW_COVERED = (
    "The model learned from these angles and readings. Outside of them it extrapolates: poses are flagged, "
    "and errors are larger than those above. The active range is how far the joint of a healthy hand goes by "
    "its own strength."
)
ENDS = {"low": "lowest", "usual_low": "95 % from", "usual_high": "95 % to", "high": "highest"}


@answer
class CoveredRange:
    """How far a rotation or a sensor went in the training takes."""

    name: str
    low: float
    """Degrees, or raw readings."""
    high: float
    usual_low: float
    """95 % of the frames lie between it and `usual_high`."""
    usual_high: float


def covered_angles(takes: Sequence[Take], rotations: Sequence[str]) -> list[CoveredRange]:
    """Of those ``rotations`` that some take measured."""
    covered = []
    for name in rotations:
        seen = [take.reference[:, take.rotations.index(name)] for take in takes if name in take.rotations]
        covered += _covered(name, seen)
    return covered


def covered_readings(takes: Sequence[Take]) -> list[CoveredRange]:
    """Of every sensor; without pre-rolls, from which nothing is learned."""
    covered = []
    for name in dict.fromkeys(name for take in takes for name in take.sensors):
        own = [take for take in takes if name in take.sensors]
        covered += _covered(
            name, [take.readings[take.time_s >= take.start_s, take.sensors.index(name)] for take in own]
        )
    return covered


def _covered(name: str, seen: Sequence[np.ndarray]) -> list[CoveredRange]:
    """Nothing where nothing was measured."""
    values = np.concatenate([*seen, np.empty(0)])
    known = values[np.isfinite(values)]
    if not len(known):
        return []
    low, usual_low, usual_high, high = np.percentile(known, [0, 2.5, 97.5, 100]).tolist()
    return [CoveredRange(name, low, high, usual_low, usual_high)]


def coverage_parts(angles: Sequence[CoveredRange], readings: Sequence[CoveredRange]) -> list[Part]:
    """As they stand in a report."""
    if not readings:
        return ["None of the takes is stored here: what they covered is unknown."]
    parts: list[Part] = [Explanation(HOW_COVERED)]
    if angles:
        sentences = unseen(angles)
        parts += [_chart(angles, len(sentences)), *([Lines(sentences)] if sentences else [])]
        parts.append(_table("rotation", "deg", angles, "Measured angles, degrees."))
    return [*parts, _table("sensor", "counts", readings, "Raw readings, in the glove's counts.")]


def unseen(angles: Sequence[CoveredRange]) -> list[str]:
    """Ends of active ranges that were not reached."""
    sentences = []
    for item in angles:
        low, high = _active(item)
        ends = [f"{low:.0f} to {item.low:.0f}"] * (item.low - low > UNSEEN_DEG)
        ends += [f"{item.high:.0f} to {high:.0f}"] * (high - item.high > UNSEEN_DEG)
        if ends:
            sentences.append(f"{item.name}: {' and '.join(ends)} degrees were not seen in training.")
    return sentences


def _active(item: CoveredRange) -> tuple[float, float]:
    return ACTIVE_RANGE_DEG.get(item.name, (item.low, item.high))


def _table(what: str, unit: str, covered: Sequence[CoveredRange], legend: str) -> Table:
    columns = [Column(f"{name}_{unit}", heading, 1) for name, heading in ENDS.items()]
    rows = [(item.name, *(getattr(item, name) for name in ENDS)) for item in covered]
    return Table([Column(what), *columns], rows, legend)


def _chart(angles: Sequence[CoveredRange], missing: int) -> Chart:
    def draw(axes: Axes) -> None:
        rows = range(len(angles))
        for spans, height, colour, alpha, label in (
            ([_active(item) for item in angles], 0.7, QUIET, 0.6, "active range"),
            ([(item.low, item.high) for item in angles], 0.4, MODEL, 0.5, "seen in training"),
            ([(item.usual_low, item.usual_high) for item in angles], 0.4, MODEL, 1.0, "95 % of frames"),
        ):
            widths, left = [high - low for low, high in spans], [low for low, _ in spans]
            axes.barh(rows, widths, left=left, height=height, color=colour, alpha=alpha, label=label)
        axes.set_yticks(rows, [item.name for item in angles])
        axes.set_ylim(len(angles) - 0.4, -0.6)
        axes.set_xlabel("measured angle, degrees")
        legend_above(axes)

    sentence = "Every joint went through its active range."
    if missing:
        sentence = f"{counted(missing, 'rotation')} did not reach an end of the joint's active range."
    return Chart(draw, 7, 1.4 + 0.24 * len(angles), sentence)
