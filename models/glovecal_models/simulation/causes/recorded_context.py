"""Causes outside every catalogue that follow a recorded column of an unfamiliar name."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def _slow(random: np.random.Generator, times_s: np.ndarray, low_s: float, high_s: float) -> np.ndarray:
    """A smooth random course of standard deviation about 1."""
    periods = random.uniform(low_s, high_s, 5)
    phases = random.uniform(0, 2 * np.pi, 5)
    waves = np.sin(2 * np.pi * times_s[:, None] / periods + phases)
    return np.asarray(np.sqrt(0.4) * waves.sum(axis=1))


def strap_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """A strap's tension: drawn for each wearing, falling slowly, with a course of its own in each take."""
    values = []
    for start, since in zip(scene.starts, scene.since_donned_s, strict=True):
        level = draws.stream("strap_level", start.wearing).uniform(-0.6, 1.0)
        course = _slow(draws.stream("strap_course", start.key), scene.time_s, 8.0, 40.0)
        values.append(level - 0.4 * np.tanh(np.maximum(since, 0.0) / 600) + 0.6 * course)
    return "strap_tension", np.clip(np.stack(values), -2.0, 2.0)


def tilt_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """Gravity along the hand: it turns to and fro about some way of holding it in each take."""
    values = []
    for start in scene.starts:
        held = draws.stream("tilt_held", start.key).uniform(-0.7, 0.7)
        turning = _slow(draws.stream("tilt_turning", start.key), scene.time_s, 2.0, 12.0)
        values.append(np.sin(held + 0.8 * turning))
    return "tilt_g", 1.5 * np.stack(values)


def lining_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """The state of a lining: a level for each take, and a course within it."""
    values = []
    for start in scene.starts:
        level = draws.stream("lining_level", start.key).uniform(-0.9, 0.9)
        values.append(level + 0.5 * _slow(draws.stream("lining_course", start.key), scene.time_s, 15.0, 60.0))
    return "lining_state", np.clip(np.stack(values), -2.0, 2.0)


@form(
    Stage.WEARING,
    "From one level to another around one value of a recorded column (sigmoid; ours).",
    touches="one_or_all",
    column=strap_column,
    only_by_name=True,
)
def context_threshold(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A hyperbolic tangent of the strap's tension."""
    _, tension = strap_column(scene, draws)
    place = draws.each("place", -0.4, 0.6)
    width = draws.each("width", 0.25, 0.7)
    return signal + size * 1.5 * draws.signs() * np.tanh((tension[..., None] - place) / width)


@form(
    Stage.WEARING,
    "A recorded column times a bow over the own bend, nothing at both ends of the range (ours).",
    touches="one_or_all",
    column=tilt_column,
    only_by_name=True,
)
def context_times_bow(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The tilt of the hand lets the cloth hang down where the joint is half bent."""
    _, tilt = tilt_column(scene, draws)
    curved = draws.each("curved", -0.3, 0.3)
    bend = np.clip((signal - scene.low) / scene.span, 0.0, 1.0)
    hangs = tilt[..., None] + curved * tilt[..., None] ** 2
    return signal + size * 2 * draws.signs() * hangs * np.sin(np.pi * bend)


@form(
    Stage.WEARING,
    "An exponential rise over a recorded column that also stretches the reading (ours).",
    touches="one_or_all",
    column=lining_column,
    only_by_name=True,
)
def context_exponential(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Hardly anything on one side of the column and ever more on the other, more so when bent."""
    _, state = lining_column(scene, draws)
    steep = draws.each("steep", 0.6, 1.2) * draws.signs("steep_side")
    grows = draws.each("grows", 0.0, 0.8)
    bend = (signal - scene.low) / scene.span
    rise = np.expm1(steep * state[..., None])
    return signal + size * draws.signs() * rise * (1 + grows * (bend - 0.5))


FORMS = (context_threshold, context_times_bow, context_exponential)
