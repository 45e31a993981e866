"""Creep: a held bend goes on changing the reading for seconds to minutes, and is forgotten as slowly.

Water that leaves a foam makes a series of times of one diffusion; the time itself may depend on how far the
polymer is strained; and a layer behind another one begins to give only after the first has.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import fftconvolve

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

SETTLED_S = 1.5
TERMS = 12


@form(
    Stage.MECHANICAL,
    "Fluid is squeezed from a soft layer: the series of times of one diffusion (poroelasticity; Biot 1941).",
    only_by_name=True,
)
def squeezed_fluid(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Every step of bend drains like a slab: with the root of time first, exponentially in the end."""
    drained = draws.one("drained_s", 15.0, 45.0)
    odd = (2 * np.arange(TERMS) + 1)[:, None]
    left = np.sum(8 / (np.pi * odd) ** 2 * np.exp(-(odd**2) * _ages(scene) / drained), axis=0)
    return signal + size * draws.sign() * _since_steps(signal, scene, 1.0 - left)


@form(
    Stage.MECHANICAL,
    "Strain opens free volume, so that a bent strip relaxes many times faster (Knauss & Emri 1981).",
    only_by_name=True,
)
def bend_quickens_creep(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One relaxation whose time falls exponentially with the bend at that moment."""
    straight_s = draws.each("straight_s", 20.0, 45.0)
    quicker = draws.each("quicker", 1.5, 2.7)
    share = np.clip((scene.own - scene.low) / scene.span, 0.0, 1.0)
    step = -np.expm1(-1 / (straight_s * np.exp(-quicker * share) * scene.rate_hz))
    relaxed = np.empty_like(signal)
    state = signal[:, 0]
    for frame in range(signal.shape[1]):
        state = state + step[:, frame] * (signal[:, frame] - state)
        relaxed[:, frame] = state
    usual = scene.low + 0.4 * scene.span
    return signal + size * draws.sign() * (relaxed - usual)


@form(
    Stage.MECHANICAL,
    "A layer behind the cloth gives only once the cloth has: creep that sets in late (two elements"
    " in a row; ours).",
    only_by_name=True,
)
def foam_behind_cloth(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The answer to a step of bend starts flat, rises after some seconds and levels off."""
    ages = _ages(scene) / draws.one("layer_s", 4.0, 11.0)
    return signal + size * draws.sign() * _since_steps(signal, scene, 1.0 - (1.0 + ages) * np.exp(-ages))


def _since_steps(signal: np.ndarray, scene: Scene, response: np.ndarray) -> np.ndarray:
    """The sum over all past changes of each change times ``response`` (N,) at its age, less what is quick."""
    response = response - response[np.searchsorted(_ages(scene), SETTLED_S)]
    steps = np.diff(signal, axis=1, prepend=signal[:, :1])
    return fftconvolve(steps, response[None, :, None], axes=1)[:, : signal.shape[1]]


def _ages(scene: Scene) -> np.ndarray:
    return np.arange(len(scene.time_s)) / scene.rate_hz


FORMS = (squeezed_fluid, bend_quickens_creep, foam_behind_cloth)
