"""Set-aside forms of a sensor that is bent by other joints than its own."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def _neighbours(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """The bend 0..1 of the two nearest other joints of each sensor, each of shape (T, N, S).

    Sensors on the same joint are no neighbours; where no other joint is measured the closing hand stands in.
    """
    bend = (scene.own - scene.low) / scene.span
    channels = bend.shape[-1]
    nearest, second = np.empty_like(bend), np.empty_like(bend)
    for sensor in range(channels):
        others = [
            bend[..., other]
            for other in sorted(range(channels), key=lambda place: abs(place - sensor))
            if not np.array_equal(scene.own[..., other], scene.own[..., sensor])
        ] or [scene.closing]
        nearest[..., sensor], second[..., sensor] = others[0], others[min(1, len(others) - 1)]
    return nearest, second


@form(
    Stage.MECHANICAL,
    "The web of cloth between two joints is pulled by the difference of their bends and levels off (ours).",
    set_aside=True,
    touches="two",
)
def difference_levels_off(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each neighbour pulls with the hyperbolic tangent of how much more it is bent than the own joint."""
    width = draws.each("width", 0.15, 0.4)
    share = draws.each("share", 0.6, 1.0)
    own = (scene.own - scene.low) / scene.span
    nearest, second = _neighbours(scene)
    pull = share * np.tanh((nearest - own) / width) + (1 - share) * np.tanh((second - own) / width)
    return signal + size * draws.signs() * pull


@form(
    Stage.MECHANICAL,
    "Cloth is drawn in only when both neighbours are bent together: the product of their bends (ours).",
    set_aside=True,
    touches="two",
)
def both_neighbours(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The pull is the product of two other joints' bends, so that either alone does nothing."""
    nearest, second = _neighbours(scene)
    return signal + size * 3 * draws.signs() * (nearest * second - 0.25)


@form(
    Stage.MECHANICAL,
    "A neighbour's knuckle lifts the sensor while it passes half-way under it and lets it down again (ours).",
    set_aside=True,
    touches="two",
)
def passing_knuckle(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The pull rises and falls as a bell curve over the nearest neighbour's bend."""
    place = draws.each("place", 0.35, 0.65)
    width = draws.each("width", 0.15, 0.25)
    nearest, _ = _neighbours(scene)
    lift = np.exp(-0.5 * ((nearest - place) / width) ** 2) - 0.5
    return signal + size * 2 * draws.signs() * lift


FORMS = (difference_levels_off, both_neighbours, passing_knuckle)
