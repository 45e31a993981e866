"""Set-aside forms of saturation."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.COUNTS,
    "An amplifier without a negative supply stops some millivolts above ground, so the most open part"
    " of the range is cut (output swing of single-supply amplifiers, data sheets).",
    set_aside=True,
    judged_by="lost_angle",
    sizes=(1.0, 90.0),
)
def rail_at_open_hand(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Everything below a level reads the same; the size is how far the level is above the lowest angle."""
    round_deg = draws.each("round_deg", 0.3, 1.2)
    level = scene.low + size - 5.0
    return level + round_deg * np.logaddexp(0.0, (signal - level) / round_deg)


@form(
    Stage.COUNTS,
    "A worn track of a joint potentiometer has a stretch where the wiper runs on bare conductor and "
    "nothing changes (wear of conductive plastic potentiometers, Todd 1975).",
    set_aside=True,
    judged_by="lost_angle",
    sizes=(1.0, 90.0),
)
def worn_stretch_of_track(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A plateau inside the range, as wide as the size; both sides stay where they were."""
    place = scene.low + scene.span * draws.each("place", 0.25, 0.45)
    start, end = place - 0.5 * size, place + 0.5 * size
    reads = start + size * draws.each("reads", 0.2, 0.8)
    return np.where((signal > start) & (signal < end), reads, signal)


@form(
    Stage.COUNTS,
    "A fibre bent far has lost nearly all of its light, and each further degree takes only a share of"
    " what is left (Marcuse 1976; optical bend sensors, Fujiwara and others 2014).",
    set_aside=True,
    judged_by="lost_angle",
    sizes=(1.0, 110.0),
)
def light_runs_out(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Beyond a knee the response fades; the size is how far the knee is below the highest angle."""
    fades = draws.each("fades_deg", 1.0, 4.0)
    over = np.maximum(signal - (scene.high + 5.0 - size), 0.0)
    return signal - over - fades * np.expm1(-over / fades)


FORMS: tuple[Form, ...] = (rail_at_open_hand, worn_stretch_of_track, light_runs_out)
