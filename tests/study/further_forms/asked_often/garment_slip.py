"""Garment slip: the glove moves on the hand during a wearing, at random, and stays there."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

LONGEST_S = 7200


def _worn(scene: Scene, slipped: dict[int, np.ndarray]) -> np.ndarray:
    """Each wearing's course (seconds since donning, S) at the times of its takes, shape (T, N, S)."""
    seconds = np.arange(LONGEST_S)
    return np.stack(
        [
            np.stack([np.interp(donned, seconds, part) for part in slipped[start.wearing].T], axis=1)
            for start, donned in zip(scene.starts, scene.since_donned_s, strict=True)
        ]
    )


def _wearings(scene: Scene) -> list[int]:
    return sorted({start.wearing for start in scene.starts})


@form(
    Stage.WEARING,
    "Now and then a strong grip shifts the glove: a few sudden steps that last (compound Poisson; ours).",
    only_by_name=True,
)
def shifted_by_grips(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A step every one to three minutes, of a size and direction of its own for each sensor."""
    every_s = draws.one("every_s", 60.0, 180.0)
    slipped = {}
    for wearing in _wearings(scene):
        random = draws.stream("steps", wearing)
        happens = random.random((LONGEST_S, 1)) < 1.0 / every_s
        steps = random.standard_normal((LONGEST_S, signal.shape[2]))
        slipped[wearing] = np.cumsum(happens * steps, axis=0)
    return signal + size * _worn(scene, slipped)


@form(
    Stage.WEARING,
    "Every move shifts the cloth by a little: each sensor's zero wanders slowly (random walk; ours).",
    only_by_name=True,
)
def wandering_cloth(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Many tiny steps, partly common to all sensors."""
    common = draws.one("common", 0.2, 0.6)
    slipped = {}
    for wearing in _wearings(scene):
        random = draws.stream("walk", wearing)
        steps = (1 - common) * random.standard_normal((LONGEST_S, signal.shape[2]))
        steps += common * random.standard_normal((LONGEST_S, 1))
        slipped[wearing] = np.cumsum(steps, axis=0) / 20.0
    return signal + size * _worn(scene, slipped)


@form(
    Stage.WEARING,
    "The glove works itself off the hand by many small slips in one direction, fewer as it settles (ours).",
    only_by_name=True,
)
def working_itself_off(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Exponential slips, all sensors at once; each takes its part, less when bent (taut cloth)."""
    every_s, settles_s = draws.one("every_s", 15.0, 40.0), draws.one("settles_s", 600.0, 1800.0)
    part = draws.each("part", 0.5, 1.5) * draws.sign()
    fading = draws.one("fading", 0.1, 0.4)
    slipped = {}
    for wearing in _wearings(scene):
        random = draws.stream("slips", wearing)
        rate = np.exp(-np.arange(LONGEST_S) / settles_s) / every_s
        slips = (random.random(LONGEST_S) < rate) * random.exponential(1.0, LONGEST_S)
        slipped[wearing] = np.cumsum(slips)[:, None] * part / 10.0
    share = np.clip((signal - scene.low) / scene.span, 0.0, 1.0)
    return signal + size * _worn(scene, slipped) * (1 - fading * share)


FORMS = (shifted_by_grips, wandering_cloth, working_itself_off)
