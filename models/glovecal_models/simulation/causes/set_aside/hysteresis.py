"""Set-aside forms of a sensor whose reading depends on the way its joint came, at whatever speed."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "A band over the knuckle slides only past a ratio of pulls that grows with its wrap (Euler's capstan).",
    set_aside=True,
)
def capstan(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The band's far end stays put until the near end pulls stronger or weaker by the capstan's factor."""
    friction = draws.each("friction", 0.08, 0.3)
    pretension = draws.each("pretension", 0.1, 0.4)
    bend = np.clip((signal - scene.low) / scene.span, 0.0, 1.3)
    pull = bend + pretension
    grip = np.exp(friction * (0.2 + 1.6 * bend))
    slides_up, slides_down = pull / grip, pull * grip
    far = np.empty_like(pull)
    now = pull[:, 0]
    for step in range(pull.shape[1]):
        now = np.minimum(np.maximum(now, slides_up[:, step]), slides_down[:, step])
        far[:, step] = now
    return signal + size * 5 * (far - pull)


@form(
    Stage.MECHANICAL,
    "A state that runs after an S-curve of the angle with the path travelled (Coleman & Hodgdon 1986).",
    set_aside=True,
)
def coleman_hodgdon(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The loop is open where the S-curve is steep and closed towards both ends of the range."""
    place = draws.each("place", 0.3, 0.7)
    width = draws.each("width", 0.15, 0.3)
    path = draws.each("path", 0.1, 0.25)
    bend = (signal - scene.low) / scene.span
    curve = np.tanh((bend - place) / width)
    forget = -np.expm1(-np.abs(np.diff(bend, axis=1)) / path)
    state = np.empty_like(bend)
    state[:, 0] = now = curve[:, 0]
    for step in range(1, bend.shape[1]):
        now = now + forget[:, step - 1] * (curve[:, step] - now)
        state[:, step] = now
    return signal + size * 2 * draws.signs() * (state - curve)


def _upper_branch(load: np.ndarray) -> np.ndarray:
    """The largest root x of x^3 - x = load, for loads of at least the lower fold."""
    ratio = np.maximum(load * 1.5 * np.sqrt(3), -1.0)
    inside = np.cos(np.arccos(np.minimum(ratio, 1.0)) / 3)
    outside = np.cosh(np.arccosh(np.maximum(ratio, 1.0)) / 3)
    return np.asarray(2 / np.sqrt(3) * np.where(ratio > 1, outside, inside))


@form(
    Stage.MECHANICAL,
    "A strip that buckles at one angle when closing and snaps back at a lower one (cusp of a buckled strip).",
    set_aside=True,
)
def snap_through(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The strip stays on its branch of a cubic's equilibria until that branch ends."""
    place = draws.each("place", 0.35, 0.6)
    half_width = draws.each("half_width", 0.08, 0.18)
    fold = 2 / (3 * np.sqrt(3))
    load = fold * ((signal - scene.low) / scene.span - place) / half_width
    decided = np.abs(load) > fold
    decided[:, 0] = True
    frames = np.arange(load.shape[1])[:, None]
    last = np.maximum.accumulate(np.where(decided, frames, 0), axis=1)
    up = np.take_along_axis(load, last, axis=1) > 0
    buckled = np.where(up, _upper_branch(load), -_upper_branch(-load))
    return signal + size * draws.signs() * buckled


FORMS = (capstan, coleman_hodgdon, snap_through)
