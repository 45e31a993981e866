"""Temperature: readings move with the temperature that the thermometer shows.

Firmware corrects by a table of whole steps, a piezoelectric film answers to warming rather than to warmth,
and a strip of two layers curls where the finger does not hold it.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Firmware corrects the zero points by a table of whole steps; what lies between is left over"
    " (sawtooth; ours).",
    only_by_name=True,
)
def corrected_in_steps(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The error rises with the temperature and falls back at each entry of the table."""
    step = draws.one("step_c", 0.8, 1.6)
    left = np.mod(scene.temperature_c / step + draws.one("first_entry", 0.0, 1.0), 1.0) - 0.5
    return signal + size * draws.signs() * draws.each("share", 0.6, 1.4) * 5.0 * left[:, :, None]


@form(
    Stage.ELECTRICAL,
    "A polar film gives charge while it warms or cools, which leaks away (pyroelectricity of PVDF).",
    only_by_name=True,
)
def film_gives_charge(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points follow how fast the temperature changed within the last half minute."""
    leaks_s = draws.one("leaks_s", 8.0, 25.0)
    warming = np.gradient(scene.temperature_c, 1 / scene.rate_hz, axis=1)
    keep = np.exp(-1 / (leaks_s * scene.rate_hz))
    charge = np.empty_like(warming)
    state = warming[:, 0]
    for frame in range(warming.shape[1]):  # pyright: ignore
        state = keep * state + (1 - keep) * warming[:, frame]
        charge[:, frame] = state
    # Some hundredths of a degree a second are usual.
    return signal + size * draws.signs() * draws.each("share", 0.6, 1.4) * 500.0 * charge[:, :, None]


@form(
    Stage.ELECTRICAL,
    "Two layers that expand unequally curl the strip where the finger leaves it free (Timoshenko's"
    " bimetal; ours).",
    only_by_name=True,
)
def curls_when_free(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """In proportion to the temperature, most while straight and nothing once the bend holds the strip."""
    held = draws.each("held_from", 0.5, 0.9)
    free = np.square(np.clip(1 - (signal - scene.low) / scene.span / held, 0.0, 1.2))
    warmer = (scene.temperature_c - scene.usual_air[0])[:, :, None]
    return signal + size * draws.signs() * 5.0 * warmer * free


FORMS = (corrected_in_steps, film_gives_charge, curls_when_free)
