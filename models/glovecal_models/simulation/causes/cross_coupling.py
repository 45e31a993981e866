"""Cross-coupling: bending one finger pulls the cloth over another one's sensor.

Wang & Neff 2013, Table 1, and Kahlesz, Zachmann & Klein 2004 measured it, the latter
mostly not in straight lines.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

USUAL_BEND = 0.4
"""Pulls count from here, so that they need not push a reading out of the converter's range."""


@form(
    Stage.MECHANICAL,
    "Two neighbours pull in proportion to their bend (Wang & Neff 2013, Table 1).",
    touches="two",
)
def linear_neighbours(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Two other joints pull in proportion to their bend."""
    return signal + size * ((_bent(scene) - USUAL_BEND) @ _pulls(scene, draws))


@form(
    Stage.MECHANICAL,
    "Neighbours pull more the more the own joint is bent (a nonlinear coupling; the shape is ours).",
    touches="two",
)
def bilinear(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The pull of the others grows as the sensor's own joint bends."""
    own = _bent(scene)
    return signal + size * ((own - USUAL_BEND) @ _pulls(scene, draws)) * (
        draws.each("unbent_share", 0.2, 0.6) + own
    )


@form(
    Stage.MECHANICAL,
    "Neighbours pull only once the cloth's slack is used up (ours).",
    touches="two",
)
def one_sided(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The cloth is slack at first: others pull only beyond a part of their range."""
    slack = draws.each("slack_share", 0.3, 0.55)
    return signal + size * (np.maximum(_bent(scene) - slack, 0.0) @ _pulls(scene, draws))


def _bent(scene: Scene) -> np.ndarray:
    return (scene.own - scene.low) / scene.span


def _pulls(scene: Scene, draws: Draws) -> np.ndarray:
    """Shape (S from, S to): two neighbours for every sensor, in degrees per range; one if there is one."""
    count = len(scene.sensors)
    pulls = np.zeros((count, count))
    sign = draws.sign()
    for to in range(count):
        random = draws.stream("neighbours", to)
        others = sorted((place for place in range(count) if place != to), key=lambda place: abs(place - to))
        near = random.permutation(others[:4])[:2]
        pulls[near, to] = sign * random.uniform(0.5, 1.0, len(near)) * random.choice([1.0, 1.0, -1.0])
        draws.values[f"pulls_on_{scene.sensors[to]}"] = [round(float(value), 4) for value in pulls[:, to]]
    return pulls


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
    touches="two",
    only_by_name=True,
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
    touches="two",
    only_by_name=True,
)
def both_neighbours(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The pull is the product of two other joints' bends, so that either alone does nothing."""
    nearest, second = _neighbours(scene)
    return signal + size * 3 * draws.signs() * (nearest * second - 0.25)


@form(
    Stage.MECHANICAL,
    "A neighbour's knuckle lifts the sensor while it passes half-way under it and lets it down again (ours).",
    touches="two",
    only_by_name=True,
)
def passing_knuckle(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The pull rises and falls as a bell curve over the nearest neighbour's bend."""
    place = draws.each("place", 0.35, 0.65)
    width = draws.each("width", 0.15, 0.25)
    nearest, _ = _neighbours(scene)
    lift = np.exp(-0.5 * ((nearest - place) / width) ** 2) - 0.5
    return signal + size * 2 * draws.signs() * lift


FORMS = (
    linear_neighbours,
    bilinear,
    one_sided,
    difference_levels_off,
    both_neighbours,
    passing_knuckle,
)
