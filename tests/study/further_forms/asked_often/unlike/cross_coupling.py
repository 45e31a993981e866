"""Cross coupling: sensors in one string, skin that stiffens, and a pull that friction uses up."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def _neighbours(scene: Scene, draws: Draws) -> np.ndarray:
    """Two other sensors for each one, as shares of their ranges, shape (2, T, N, S)."""
    random, count = draws.stream("neighbours"), len(scene.sensors)
    share = (scene.own - scene.low) / scene.span
    others = [[other for other in range(count) if other != own] or [own] for own in range(count)]
    two = np.array([random.choice(ones, 2, replace=len(ones) < 2) for ones in others])
    return np.stack([share[:, :, two[:, 0]], share[:, :, two[:, 1]]])


@form(
    Stage.MECHANICAL,
    "Three sensors in series hang on one voltage, and each gets its share of it (Kirchhoff's voltage law).",
    only_by_name=True,
    touches="two",
)
def string_shares_voltage(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Of the share a sensor gets, what it gets with both others half bent is its own curve."""
    growth = draws.one("growth", 0.6, 2.0)
    own = 1 + growth * np.clip((signal - scene.low) / scene.span, -0.2, 1.2)
    others = 2 + growth * _neighbours(scene, draws).sum(0)
    return signal + size * 100 * (own / (own + others) - own / (own + 2 + growth))


@form(
    Stage.MECHANICAL,
    "Skin between the fingers pulls, and stiffens exponentially as neighbours stretch it (Fung 1967).",
    only_by_name=True,
    touches="two",
)
def skin_web_stiffens(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each neighbour stretches a web of its own."""
    stiffening = draws.one("stiffening", 2.5, 5.0)
    weights = draws.stream("weights").uniform(0.4, 1.0, (2, 1, 1, signal.shape[2]))
    stretched = np.expm1(stiffening * _neighbours(scene, draws)) / np.expm1(stiffening)
    return signal + size * 10 * draws.signs() * (weights * stretched).sum(0)


@form(
    Stage.MECHANICAL,
    "The neighbours' pull runs round the own knuckle, where friction uses it up (Euler and Eytelwein).",
    only_by_name=True,
    touches="two",
)
def friction_uses_up_pull(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The further the own joint is bent, the less arrives: exponential in the angle of wrap."""
    friction = draws.each("friction", 0.5, 1.3)
    weights = draws.stream("weights").uniform(0.4, 1.0, (2, 1, 1, signal.shape[2]))
    arrives = np.exp(-friction * np.radians(np.maximum(signal, 0.0)))
    return signal + size * 10 * draws.signs() * arrives * (weights * _neighbours(scene, draws)).sum(0)


FORMS = (string_shares_voltage, skin_web_stiffens, friction_uses_up_pull)
