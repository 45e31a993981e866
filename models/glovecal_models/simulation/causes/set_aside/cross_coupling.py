"""Cross-coupling: another joint's bend moves a sensor, at once and the same way every time.

Cloth between two joints is one piece: it has a length to share out, threads across it, and a tautest one.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "Only the more bent of two neighbours pulls, as the tautest thread carries all (ours).",
    set_aside=True,
    touches="two",
)
def tautest_thread(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The larger of two neighbours' bends, each with its own lever, pulls at the sensor."""
    one, other = _neighbours(scene)
    lever = draws.each("lever", 0.7, 1.4)
    return signal + size * draws.sign() * 2 * (np.maximum(one, lever * other) - 0.4)


@form(
    Stage.MECHANICAL,
    "A thread from base to tip spans two joints: the chord of three links in a chain (plane geometry; ours).",
    set_aside=True,
    touches="two",
)
def chord_of_two_joints(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """How far the neighbour's bend shortens the chord, beyond what it does at its usual bend."""
    one, _ = _neighbours(scene)
    links = draws.each("middle", 0.6, 1.2), draws.each("last", 0.6, 1.2)
    own = np.radians(scene.own)

    def chord(neighbour: np.ndarray) -> np.ndarray:
        folded = links[0] * np.exp(1j * own) + links[1] * np.exp(1j * (own + np.radians(95 * neighbour)))
        return np.abs(1 + folded)

    usual = np.full_like(one, 0.35)
    return signal + size * draws.sign() * 3 * (chord(usual) - chord(one))


@form(
    Stage.MECHANICAL,
    "Own and neighbouring bends draw on one stock of cloth; beyond it all pull at each other (ours).",
    set_aside=True,
    touches="two",
)
def stock_of_cloth(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """What three joints together ask for beyond the stock of loose cloth, with a soft corner."""
    one, other = _neighbours(scene)
    weight = draws.each("weight", 0.2, 0.8)
    asked = 0.6 * _bends(scene) + 1.4 * (weight * one + (1 - weight) * other)
    soft = draws.one("soft", 0.05, 0.12)
    return signal - size * 3 * soft * np.logaddexp(0, (asked - draws.each("stock", 0.7, 1.0)) / soft)


def _bends(scene: Scene) -> np.ndarray:
    """Every sensor's own bend as a share of its range."""
    return (scene.own - scene.low) / scene.span


def _neighbours(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """The bends of the two sensors nearest in the glove's order, each (T, N, S)."""
    bends, count = _bends(scene), len(scene.sensors)
    nearest = [
        sorted((k for k in range(count) if k != i), key=lambda k, i=i: abs(k - i)) for i in range(count)
    ]
    return bends[:, :, [order[0] for order in nearest]], bends[
        :, :, [order[-1 if len(order) < 2 else 1] for order in nearest]
    ]


FORMS = (tautest_thread, chord_of_two_joints, stock_of_cloth)
