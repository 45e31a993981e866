"""Clock offset: a clock slewed evenly, cameras locked to the mains, and an oscillator on the battery."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import at_times


def _seen(signal: np.ndarray, scene: Scene, offset: np.ndarray) -> np.ndarray:
    times = zip(signal, scene.time_s + offset, strict=True)
    return np.stack([at_times(scene.time_s, take, when) for take, when in times])


@form(
    Stage.CLOCK,
    "A clock is slewed at one even rate towards what the last check found, and then holds (adjtime of BSD).",
    only_by_name=True,
    shared=True,
    sizes=(0.002, 1.2),
)
def slewed_at_even_rate(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """What checks find is off at random (delay of the network); ramps at one slope, then level."""
    apart, slewing = draws.one("checks_apart_s", 200.0, 400.0), draws.one("slewing_s", 100.0, 200.0)
    since = scene.session_s + draws.one("first_s", 100.0, 300.0)
    check = np.maximum(since // apart, 0).astype(int)
    found = draws.stream("found").uniform(-1.6, 1.6, check.max() + 1)
    at_check = np.zeros(check.max() + 1)
    for k in range(check.max()):
        at_check[k + 1] = at_check[k] + np.clip(found[k] - at_check[k], -apart / slewing, apart / slewing)
    farthest = (since - check * apart) / slewing
    moved = np.clip(found[check] - at_check[check], -farthest, farthest)
    return _seen(signal, scene, size[0] * (at_check[check] + moved))


@form(
    Stage.CLOCK,
    "Cameras locked to the mains keep its time, the sum of a wandering frequency (grid time deviation).",
    only_by_name=True,
    shared=True,
    sizes=(0.002, 1.2),
)
def locked_to_mains(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Waves of frequency from one to thirty minutes, alike in height: slow ones gather most time."""
    random = draws.stream("waves")
    periods = np.geomspace(60.0, 1800.0, 7) * random.uniform(0.85, 1.15, 7)
    phases, offset = random.uniform(0, 2 * np.pi, 7), np.zeros_like(scene.session_s)
    for period, phase in zip(periods, phases, strict=True):
        turned = 2 * np.pi * scene.session_s / period + phase
        offset += period / 1000 * (np.sin(turned) - np.sin(phase))
    return _seen(signal, scene, size[0] * offset)


@form(
    Stage.CLOCK,
    "An RC oscillator slows evenly as its battery empties: the offset is a parabola of time (ours).",
    only_by_name=True,
    shared=True,
    sizes=(0.002, 1.2),
)
def oscillator_slows_evenly(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Its rate is right at one moment of the session, where the clocks agree."""
    right_s, sign = draws.one("right_s", 200.0, 900.0), draws.sign()
    return _seen(signal, scene, sign * size[0] * ((scene.session_s - right_s) / 1000) ** 2)


FORMS = (slewed_at_even_rate, locked_to_mains, oscillator_slows_evenly)
