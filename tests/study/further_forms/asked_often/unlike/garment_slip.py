"""Garment slip: cloth with two creases, a glove that is pulled up again, and folds handed on."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.WEARING,
    "A finger's cloth sits in one of two creases and changes over at random (two-state Markov; ours).",
    only_by_name=True,
)
def sits_in_two_creases(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each finger by itself, for a minute or two at a time."""
    stays, shift = draws.one("stays_s", 50.0, 130.0), np.empty_like(signal)
    for take, start in enumerate(scene.starts):
        random = draws.stream("creases", start.wearing)
        changes = np.cumsum(random.exponential(stays, (200, signal.shape[2])), axis=0)
        first = random.integers(0, 2, signal.shape[2])
        for place in range(signal.shape[2]):
            passed = np.searchsorted(changes[:, place], scene.since_donned_s[take])
            shift[take, :, place] = (first[place] + passed) % 2 - 0.5
    return signal + size * draws.signs() * 4 * shift


@form(
    Stage.WEARING,
    "The glove works down evenly, and now and then its wearer pulls it up again: uneven saw teeth (ours).",
    only_by_name=True,
)
def pulled_up_again(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """All sensors together, at moments of the wearer's own; each pull leaves another rest."""
    apart = draws.one("apart_s", 80.0, 180.0)
    rates = draws.each("rates", 0.6, 1.4) * draws.signs()
    down = np.empty(signal.shape[:2])
    for take, start in enumerate(scene.starts):
        random = draws.stream("pulls", start.wearing)
        pulls = np.concatenate([[-1e9, 0.0], np.cumsum(random.exponential(apart, 200))])
        rest = random.uniform(0.0, 0.5, len(pulls))
        worn = np.maximum(scene.since_donned_s[take], 0.0)
        last = np.searchsorted(pulls, worn, side="right") - 1
        down[take] = rest[last] + (worn - pulls[last]) / apart
    return signal + size * rates * 3 * down[:, :, None]


@form(
    Stage.WEARING,
    "Folds of cloth pass at random to the neighbour: what one gains the other loses (conserved; ours).",
    only_by_name=True,
)
def folds_pass_to_neighbour(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each fold stays where it has gone until another one passes."""
    apart, sensors = draws.one("apart_s", 8.0, 20.0), signal.shape[2]
    shift = np.empty_like(signal)
    for take, start in enumerate(scene.starts):
        random = draws.stream("folds", start.wearing)
        moments = np.cumsum(random.exponential(apart, 1500))
        giver = random.integers(0, max(sensors - 1, 1), moments.size)
        folds = random.exponential(1.0, moments.size) * random.choice([-1.0, 1.0], moments.size)
        moved = np.zeros((moments.size + 1, sensors))
        moved[np.arange(1, moments.size + 1), giver] = -folds
        if sensors > 1:
            moved[np.arange(1, moments.size + 1), giver + 1] = folds
        shift[take] = np.cumsum(moved, axis=0)[np.searchsorted(moments, scene.since_donned_s[take])]
    return signal + size * shift


FORMS = (sits_in_two_creases, pulled_up_again, folds_pass_to_neighbour)
