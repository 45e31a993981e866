"""Contact pressure: a film that gives charge, a grip shared out by bend, and a strip that buckles aside."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from glovecal_models.simulation.causes.contact_pressure import _pressure, contact_column
from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "A piezoelectric film gives charge when pressed or let go, and the charge leaks away (PVDF; Kawai 1969).",
    only_by_name=True,
    column=contact_column,
)
def film_gives_charge_when_pressed(
    signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws
) -> np.ndarray:
    """The force without what lasts longer than a second or so."""
    keep = np.exp(-1 / (draws.one("leaks_s", 0.4, 1.5) * scene.rate_hz))
    force = _pressure(scene, draws)
    lasting = lfilter([1 - keep], [1.0, -keep], force - force[:, :1], axis=1) + force[:, :1]
    return signal + size * draws.signs() * (force - lasting)


@form(
    Stage.MECHANICAL,
    "The grip's force falls to each sensor by its part in the bending of all: wrapped fingers carry (ours).",
    only_by_name=True,
    column=contact_column,
)
def force_shared_out_by_bend(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Own bend over the sum of all bends, times the force."""
    bent = np.clip((scene.own - scene.low) / scene.span, 0.0, 1.0)
    part = bent / (0.2 + bent.sum(2, keepdims=True))
    return signal + size * draws.signs() * part * _pressure(scene, draws)


@form(
    Stage.MECHANICAL,
    "Above a critical force the strip buckles aside, by the root of the force beyond it (Euler; pitchfork).",
    only_by_name=True,
    column=contact_column,
)
def buckles_aside(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Nothing up to the critical force, which is another one for each sensor, then steeply away."""
    beyond = _pressure(scene, draws) - draws.each("critical_n", 1.0, 3.5)
    return signal + size * draws.signs() * np.sqrt(np.maximum(beyond, 0.0))


FORMS = (film_gives_charge_when_pressed, force_shared_out_by_bend, buckles_aside)
