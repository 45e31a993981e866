"""Set-aside forms of contact pressure."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene


def _grasps(
    scene: Scene, draws: Draws, wait_s: float, hold_s: float, rise_s: float, peak_n: float
) -> np.ndarray:
    """Force of grasps that come and go by themselves, shape (T, N), newtons."""
    force = np.zeros((len(scene.starts), scene.time_s.size))
    for take, start in enumerate(scene.starts):
        random = draws.stream("grasps", start.key)
        begin = scene.time_s[0] + random.exponential(wait_s)
        while begin < scene.time_s[-1]:
            hold = hold_s * random.uniform(0.4, 1.8)
            rise = rise_s * random.uniform(0.6, 1.6)
            peak = peak_n * random.gamma(4.0, 0.25)
            knots = begin + np.array([0.0, rise, rise + hold, 1.7 * rise + hold])
            held = random.uniform(0.6, 1.1)
            force[take] += np.interp(scene.time_s, knots, [0.0, peak, held * peak, 0.0])
            begin = knots[-1] + random.exponential(wait_s)
    return force


def _recorded(force: np.ndarray, scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """The column as a thin force sensor gives it: 3 per cent of gain, a little noise, never below 0."""
    gain = draws.one("force_gain", 0.97, 1.03)
    noise = [
        draws.stream("force_noise", start.key).normal(0.0, 0.05, force.shape[1]) for start in scene.starts
    ]
    return "contact_n", np.maximum(gain * force + np.stack(noise), 0.0)


def _holding(scene: Scene, draws: Draws) -> np.ndarray:
    """Firm grasps of some seconds."""
    return _grasps(scene, draws, wait_s=3.0, hold_s=3.5, rise_s=0.5, peak_n=8.0)


@form(
    Stage.MECHANICAL,
    "An object presses the soft pad and the cloth against the strip, at first much and then less for "
    "each newton (contact of a ball, Hertz 1882).",
    set_aside=True,
    column=lambda scene, draws: _recorded(_holding(scene, draws), scene, draws),
)
def pad_flattens(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A bias with the force to the power two thirds."""
    pressed = (_holding(scene, draws) / 8.0) ** (2.0 / 3.0)
    return signal + size * draws.signs() * draws.each("felt", 1.5, 3.0) * pressed[:, :, None]


def _squeezing(scene: Scene, draws: Draws) -> np.ndarray:
    """Shorter squeezes with pauses of several seconds."""
    return _grasps(scene, draws, wait_s=4.0, hold_s=1.2, rise_s=0.3, peak_n=15.0)


@form(
    Stage.MECHANICAL,
    "Foam and skin below the strip are squeezed at once but fill again over seconds after the hand "
    "lets go (recovery of fingertip pulp, Serina and others 1997).",
    set_aside=True,
    column=lambda scene, draws: _recorded(_squeezing(scene, draws), scene, draws),
)
def pulp_fills_again(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The bias rises with the force and stays behind for a while."""
    recovers = draws.each("recovers_s", 0.8, 3.0)
    pressed = (_squeezing(scene, draws) / 15.0)[:, :, None]
    dented = np.zeros_like(signal)
    state = np.zeros_like(signal[:, 0])
    keeps, quick = np.exp(-1.0 / (scene.rate_hz * recovers)), 1.0 - np.exp(-1.0 / (scene.rate_hz * 0.08))
    for n in range(signal.shape[1]):
        state = np.maximum(state * keeps, state + quick * (pressed[:, n] - state))
        dented[:, n] = state
    return signal - size * 4.0 * dented


def _tapping(scene: Scene, draws: Draws) -> np.ndarray:
    """Many short touches of a few newtons."""
    return _grasps(scene, draws, wait_s=0.8, hold_s=0.4, rise_s=0.12, peak_n=3.0)


@form(
    Stage.MECHANICAL,
    "A touched edge only reaches a strip that stands proud of the finger, so pressure counts beyond a"
    " first force and the more the finger is bent (pressure sensitivity of bend sensors, Saggio and "
    "others 2016).",
    set_aside=True,
    column=lambda scene, draws: _recorded(_tapping(scene, draws), scene, draws),
)
def edge_meets_bent_strip(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A threshold and a limit in force, times a share of the bend."""
    first = draws.each("first_n", 0.3, 1.0)
    pressed = np.tanh(np.maximum(_tapping(scene, draws)[:, :, None] - first, 0.0) / 2.0)
    bent = np.clip((scene.own - scene.low) / scene.span, 0.0, 1.0)
    return signal + size * draws.signs() * 6.0 * pressed * (0.3 + bent)


FORMS: tuple[Form, ...] = (pad_flattens, pulp_fills_again, edge_meets_bent_strip)
