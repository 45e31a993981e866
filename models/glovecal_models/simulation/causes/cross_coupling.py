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


FORMS = (linear_neighbours, bilinear, one_sided)
