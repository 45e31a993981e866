"""Contact pressure: what the hand grips presses on the sensors, as a recorded force tells.

Padding may give slowly, keep its deepest dent while it is held, or the grip may clamp the strip.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import lasting_noise


def contact_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """Force of the grip, 0 to 8 N: it needs a closed hand and pauses now and then."""
    grip = np.empty_like(scene.closing)
    for take, start in enumerate(scene.starts):
        random = draws.stream("grip", start.key)
        rough = lasting_noise(random, grip.shape[1], 1, 3.0, scene.rate_hz)
        grip[take] = gaussian_filter1d(rough[:, 0], 0.25 * scene.rate_hz)
    return "contact_n", 8 * np.tanh(np.maximum(0.4 * grip + scene.closing - 0.3, 0.0))


@form(
    Stage.MECHANICAL,
    "Slow foam gives over seconds under the grip and comes back as slowly (viscoelastic padding).",
    set_aside=True,
    column=contact_column,
)
def slow_foam(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor follows the force of the last few seconds."""
    share = 1 - np.exp(-1 / (draws.each("seconds", 1.5, 5.0) * scene.rate_hz))
    force = contact_column(scene, draws)[1][:, :, None]
    out = np.empty_like(signal)
    state = force[:, 0] * np.ones(signal.shape[2])
    for frame in range(signal.shape[1]):
        state = state + share * (force[:, frame] - state)
        out[:, frame] = state
    return signal + size * draws.signs() * out


@form(
    Stage.MECHANICAL,
    "Padding keeps the dent of the strongest pressure until the grip lets go (set of soft layers; ours).",
    set_aside=True,
    column=contact_column,
)
def keeps_deepest_dent(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor shows the highest force since touch began, and is right again once there is none."""
    force = contact_column(scene, draws)[1]
    fills = draws.one("fills_s", 0.05, 0.3)
    fade = np.exp(-1 / (fills * scene.rate_hz))
    dent = np.empty_like(force)
    deepest = force[:, 0]
    for frame in range(force.shape[1]):
        deepest = np.maximum(np.where(force[:, frame] > 0, 1.0, fade) * deepest, force[:, frame])
        dent[:, frame] = deepest
    return signal + size * draws.signs() * draws.each("own", 0.6, 1.4) * dent[:, :, None]


@form(
    Stage.MECHANICAL,
    "A grip clamps the strip on the finger, which then follows only part of further bending (clamping; ours).",
    set_aside=True,
    column=contact_column,
)
def grip_clamps_strip(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Bending since touch began is lost in part, the more so the firmer the grip."""
    force = contact_column(scene, draws)[1][:, :, None]
    clamped = 1 - np.exp(-force / draws.each("firm_n", 0.8, 2.5))
    held = np.empty_like(signal)
    bend = signal[:, 0]
    for frame in range(signal.shape[1]):
        bend = np.where(force[:, frame] > 0, bend, signal[:, frame])
        held[:, frame] = bend
    return signal + size * 0.15 * clamped * (held - signal)


FORMS = (slow_foam, keeps_deepest_dent, grip_clamps_strip)
