"""Temperature: readings move with the temperature that the thermometer shows.

Firmware corrects by a table of whole steps, a piezoelectric film answers to warming rather than to warmth,
and a strip of two layers curls where the finger does not hold it.

Crystals have cubic curves, gaps close as parts expand, and bonded layers warp as a bimetal does.

A carrier may change its crystals, light in a fibre may interfere, or a correction may end too early.
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


@form(
    Stage.ELECTRICAL,
    "Zero points follow a cubic with two turning points (frequency of AT-cut quartz over temperature).",
    only_by_name=True,
)
def quartz_cubic(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A count made against a quartz: down, up and down again over the temperature."""
    scaled = _from_usual(scene) / draws.each("scale_c", 0.7, 1.1) - draws.each("turn", -0.3, 0.3)
    return signal + size * draws.signs() * (scaled**3 / 3 - scaled)


@form(
    Stage.ELECTRICAL,
    "Nothing moves until a gap has closed; from there parts press on each other as they expand (ours).",
    only_by_name=True,
)
def gap_closes(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """In proportion to the temperature above where the gap closes, nothing below."""
    closes_c = draws.one("closes_c", -0.7, 0.4)
    return signal + size * draws.signs() * 2 * np.maximum(_from_usual(scene) - closes_c, 0)


@form(
    Stage.ELECTRICAL,
    "Two bonded layers warp while the strip is straight; a bend holds them flat (bimetal; Timoshenko 1925).",
    only_by_name=True,
)
def bimetal_strip(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """In proportion to the temperature, less and less with the square of the bend."""
    bend = np.clip((signal - scene.low) / scene.span, 0, 1)
    held = 1 / (1 + (bend / draws.each("half_bend", 0.25, 0.5)) ** 2)
    return signal + size * draws.signs() * 3 * _from_usual(scene) * held


def _from_usual(scene: Scene) -> np.ndarray:
    return (scene.temperature_c - scene.usual_air[0])[:, :, None]


@form(
    Stage.ELECTRICAL,
    "A polymer changes its crystals, and so its volume, at one temperature (as PTFE does at 19 degC).",
    only_by_name=True,
)
def crystals_change(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points go from one level to another within tenths of a degree."""
    at = draws.one("from_usual_c", -0.6, 0.6)
    width = draws.each("width_c", 0.1, 0.3)
    state = np.tanh((_warmer(scene) - at) / width)
    return signal + size * draws.signs() * state


@form(
    Stage.ELECTRICAL,
    "Reflections in a fibre interfere, and the fringes walk as the fibre expands (Fabry-Perot).",
    only_by_name=True,
)
def fringes_walk(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A wave over the bend whose phase moves with the temperature."""
    along, period = draws.each("fringes", 0.4, 1.6), draws.each("period_c", 1.8, 5.0)
    phase = draws.each("phase", 0.0, 1.0)
    bend = (signal - scene.low) / scene.span
    warmer = _warmer(scene)
    return signal + size * 1.5 * np.sin(2 * np.pi * (along * bend + warmer / period + phase))


@form(
    Stage.ELECTRICAL,
    "Firmware corrects for temperature within a band only, and keeps its last value beyond it (ours).",
    only_by_name=True,
)
def correction_ends(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points and gains are right within a band of temperatures and drift off on both sides of it."""
    below, above = draws.one("below_c", 0.2, 0.9), draws.one("above_c", 0.2, 0.9)
    gain = draws.each("gain", 0.0, 0.8)
    warmer = _warmer(scene)
    beyond = warmer - np.clip(warmer, -below, above)
    bend = (signal - scene.low) / scene.span
    return signal + size * draws.signs() * beyond * (1 - gain + gain * bend)


def _warmer(scene: Scene) -> np.ndarray:
    """By how much the air is warmer than usual, shape (T, N, 1)."""
    return (scene.temperature_c - scene.usual_air[0])[:, :, None]


FORMS = (
    corrected_in_steps,
    film_gives_charge,
    curls_when_free,
    quartz_cubic,
    gap_closes,
    bimetal_strip,
    crystals_change,
    fringes_walk,
    correction_ends,
)
