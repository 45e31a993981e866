"""Cross coupling: other joints of the hand show in a sensor's reading.

Through a return wire that all share, through a magnet that comes alongside, and through a web with slack.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Currents of all other sensors lift the ground of a shared return wire (common-impedance coupling; Ott).",
    set_aside=True,
    touches="two",
)
def shared_return_wire(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor is lifted by the others' currents, which fall as they bend, less so when bent itself."""
    growth = draws.each("growth", 1.0, 3.0)
    bend = _bend(scene.own, scene)
    current = 1 / (1 + growth * bend)
    others = current.sum(axis=2, keepdims=True) - current
    lift = others - (bend.shape[2] - 1) / (1 + 0.4 * growth)
    return signal + size * 4 * lift * (1 - draws.one("own_share", 0.3, 0.7) * bend)


@form(
    Stage.ELECTRICAL,
    "A neighbour's magnet adds its field while both fingers are side by side (dipole: inverse cube).",
    set_aside=True,
    touches="two",
)
def magnet_alongside(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor is disturbed while it and its neighbour are about equally bent, not when they part."""
    reach = draws.each("reach", 0.12, 0.3)
    apart = _bend(scene.own, scene) - _neighbour(_bend(scene.own, scene))
    return signal + size * 4 * draws.signs() * (1 + (apart / reach) ** 2) ** -1.5


@form(
    Stage.MECHANICAL,
    "A web of cloth follows the neighbour with slack, so it rests until that is taken up (backlash; ours).",
    set_aside=True,
    touches="two",
)
def slack_web(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor is pulled by a web that its neighbour drags along behind a slack in both directions."""
    slack = draws.each("slack", 0.1, 0.25)
    bend = _neighbour(_bend(scene.own, scene))
    dragged = np.empty_like(bend)
    place = bend[:, 0]
    for frame in range(bend.shape[1]):
        place = np.clip(place, bend[:, frame] - slack, bend[:, frame] + slack)
        dragged[:, frame] = place
    return signal + size * 4 * draws.signs() * dragged


def _bend(angle: np.ndarray, scene: Scene) -> np.ndarray:
    return np.clip((angle - scene.low) / scene.span, 0.0, 1.1)


def _neighbour(values: np.ndarray) -> np.ndarray:
    """The next sensor's values for each sensor; the last one takes those before it."""
    place = np.arange(values.shape[2])
    return values[:, :, np.where(place + 1 < len(place), place + 1, place - 1)]


FORMS = (shared_return_wire, magnet_alongside, slack_web)
