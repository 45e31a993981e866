"""Nonlinearity: a shuttered window, a wire that spans the joint, and a powder that percolates."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "A straight shutter uncovers a round window before a photocell: area of a circle's segment (geometry).",
    only_by_name=True,
    judged_by="straight_line",
)
def shutter_over_round_window(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The range opens the window from nearly shut to about half, by another share in each sensor."""
    first, last = draws.each("first", 0.0, 0.04), draws.each("last", 0.35, 0.55)
    share = (signal - scene.low) / scene.span

    def lit(part: np.ndarray) -> np.ndarray:
        edge = 1 - 2 * np.clip(part, 0.0, 1.0)
        return (np.arccos(edge) - edge * np.sqrt(1 - edge**2)) / np.pi

    risen = (lit(first + (last - first) * share) - lit(first)) / (lit(last) - lit(first))
    return signal + size * 10 * (risen - share)


@form(
    Stage.ELECTRICAL,
    "A draw-wire spans the joint from phalanx to phalanx: third side of a triangle (law of cosines).",
    only_by_name=True,
    judged_by="straight_line",
)
def wire_spans_the_joint(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The two anchors lie at unequal distances from the joint and a little below its axis."""
    ratio, below_deg = draws.each("ratio", 0.35, 0.95), draws.each("below_deg", 15.0, 50.0)

    def length(angle: np.ndarray) -> np.ndarray:
        return np.sqrt(1 + ratio**2 + 2 * ratio * np.cos(np.radians(angle + below_deg)))

    longest, shortest = length(scene.low), length(scene.high)
    drawn = (longest - length(signal)) / (longest - shortest)
    return signal + size * 10 * (drawn - (signal - scene.low) / scene.span)


@form(
    Stage.ELECTRICAL,
    "Conducting grains touch: a power of the distance from the threshold (percolation; Kirkpatrick 1973).",
    only_by_name=True,
    judged_by="straight_line",
)
def grains_percolate(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The threshold lies a little below the lowest angle; powers as measured in filled rubbers."""
    power, beyond = draws.each("power", 1.5, 2.6), draws.each("beyond", 0.02, 0.12)
    share = (signal - scene.low) / scene.span
    conducts = np.maximum(share + beyond, 0.0) ** power
    least, most = beyond**power, (1 + beyond) ** power
    return signal + size * 10 * ((conducts - least) / (most - least) - share)


FORMS = (shutter_over_round_window, wire_spans_the_joint, grains_percolate)
