"""Set-aside forms of sensors that are bent when the palm is cupped."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "The first degrees of arch count most, then the cloth across the palm is slack (exponential; ours).",
    set_aside=True,
    touches="palm",
)
def levels_off(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The pull approaches a limit exponentially as the palm is cupped."""
    soon = draws.each("soon", 0.1, 0.35)
    arch = scene.bent("PALM_ARCH")[..., None]
    return signal + size * 3 * draws.signs() * (0.4 + np.expm1(-arch / soon))


@form(
    Stage.MECHANICAL,
    "Cupping tilts the joint's axis, so that the sensor sees its bend in projection (tilted hinge; ours).",
    set_aside=True,
    touches="palm",
)
def tilted_axis(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The square of the arch times the sine of twice the bend: a tilted hinge's first term."""
    start = draws.each("untilted_deg", -10.0, 25.0)
    arch = scene.bent("PALM_ARCH")[..., None]
    return signal - size * 4 * arch**2 * np.sin(2 * np.radians(signal + start))


@form(
    Stage.MECHANICAL,
    "A fold across the palm forms at a certain arch and takes up cloth while it forms (sigmoid; ours).",
    set_aside=True,
    touches="palm",
)
def palm_fold(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The pull goes from one level to another around one arch, differently placed for each sensor."""
    place = draws.each("place", 0.25, 0.55)
    width = draws.each("width", 0.06, 0.15)
    arch = scene.bent("PALM_ARCH")[..., None]
    return signal + size * 1.5 * draws.signs() * np.tanh((arch - place) / width)


FORMS = (levels_off, tilted_axis, palm_fold)
