"""Donning shift: each wearing sits differently and stays as it is until the glove is taken off."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def _per_wearing(scene: Scene, draws: Draws, name: str, count: int) -> np.ndarray:
    """``count`` normal numbers for each wearing, shape (T, 1, count)."""
    drawn = [draws.stream(name, start.wearing).standard_normal(count) for start in scene.starts]
    return np.array(drawn)[:, None, :]


@form(
    Stage.WEARING,
    "Every sensor lies a little differently over its joint: an offset of its own per wearing (ours).",
    only_by_name=True,
)
def seat_offsets(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Independent from sensor to sensor and from wearing to wearing."""
    return signal + size * _per_wearing(scene, draws, "seat", signal.shape[2])


@form(
    Stage.WEARING,
    "The sensors lie higher or lower over the joints: another lever, so another gain and zero (ours).",
    only_by_name=True,
)
def seat_levers(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Mostly a gain about the lowest angle, with a smaller offset."""
    share = (signal - scene.low) / scene.span
    zero = draws.one("zero_share", 0.15, 0.4)
    gains = _per_wearing(scene, draws, "lever", signal.shape[2])
    return signal + size * (gains * share + zero * _per_wearing(scene, draws, "zero", signal.shape[2]))


@form(
    Stage.WEARING,
    "How far the hand went in and how the glove is turned: two numbers per wearing move all sensors (ours).",
    only_by_name=True,
)
def pulled_on_and_turned(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """All fingers go with the first; each has its part in the second; a bent finger draws the cloth taut."""
    depth = draws.each("depth_part", 0.7, 1.3)
    turn = draws.each("turn_part", -1.0, 1.0)
    fading = draws.one("fading", 0.2, 0.6)
    share = np.clip((signal - scene.low) / scene.span, 0.0, 1.0)
    seat = _per_wearing(scene, draws, "seat", 2)
    return signal + size * (seat[:, :, :1] * depth + seat[:, :, 1:] * turn) * (1 - fading * share)


FORMS = (seat_offsets, seat_levers, pulled_on_and_turned)
