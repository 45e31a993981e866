"""Set-aside forms of nonlinearity."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene


def _share(signal: np.ndarray, scene: Scene) -> np.ndarray:
    """The signal as a share of each sensor's range."""
    return (signal - scene.low) / scene.span


@form(
    Stage.ELECTRICAL,
    "Macrobend loss of an optical fibre sets in exponentially with curvature (Marcuse 1976).",
    set_aside=True,
    judged_by="straight_line",
)
def fibre_loss_onset(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Hardly anything at first, then ever more."""
    steepness = draws.each("steepness", 2.0, 4.5)
    bent = np.clip(_share(signal, scene), -0.5, 1.5)
    return signal + size * draws.signs() * 4.0 * np.expm1(steepness * bent) / np.expm1(steepness)


@form(
    Stage.ELECTRICAL,
    "A rotary Hall sensor whose magnet sits off its axis errs with the second harmonic of the angle "
    "(magnetic position sensor data sheets, section on displacement).",
    set_aside=True,
    judged_by="straight_line",
)
def off_axis_magnet(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Two harmonics of the mechanical angle; the magnet turns by some 90 to 180 degrees over the range."""
    first, second = draws.each("first_rad", 0.0, 2 * np.pi), draws.each("second_rad", 0.0, 2 * np.pi)
    gear = draws.each("gear_rad", 1.5, 3.2)
    turn = gear * _share(signal, scene)
    return signal + size * (0.6 * np.sin(turn + first) + 1.4 * np.sin(2 * turn + second))


@form(
    Stage.ELECTRICAL,
    "A knitted strain gauge has two slopes: loops open their contacts up to a knee, then the yarn "
    "itself stretches (Zhang and others 2006).",
    set_aside=True,
    judged_by="straight_line",
)
def knit_knee(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A rounded kink somewhere in the range."""
    knee, width = draws.each("knee", 0.25, 0.65), draws.each("width", 0.02, 0.08)
    beyond = width * np.logaddexp(0.0, (_share(signal, scene) - knee) / width)
    return signal + size * draws.signs() * 8.0 * beyond


FORMS: tuple[Form, ...] = (fibre_loss_onset, off_axis_magnet, knit_knee)
