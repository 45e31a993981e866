"""Set-aside forms of one channel that at times tells nothing, or something else than its joint."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import lasting_noise


def _noise(scene: Scene, draws: Draws, name: str, channels: int, lasts_s: float) -> np.ndarray:
    """Noise of its own in every take, shape (T, N, channels)."""
    frames = len(scene.time_s)
    return np.stack(
        [
            lasting_noise(draws.stream(name, start.key), frames, channels, lasts_s, scene.rate_hz)
            for start in scene.starts
        ]
    )


@form(
    Stage.CONVERTER,
    "While a wire is open the floating input wanders by itself, for a share of the time (broken conductor).",
    set_aside=True,
    touches="one",
    sizes=(0.002, 0.95),
)
def floating_input(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The reading leaves its joint for some seconds at a time and drifts about some level."""
    channels = signal.shape[-1]
    level = draws.each("level", 0.3, 0.7)
    lasts_s = draws.one("lasts_s", 1.0, 4.0)
    wanders_s = draws.one("wanders_s", 1.0, 5.0)
    wire_open = ndtr(_noise(scene, draws, "contact", channels, lasts_s)) < size
    wanders = scene.low + scene.span * (level + 0.15 * _noise(scene, draws, "wander", channels, wanders_s))
    return np.where(wire_open, wanders, signal)


@form(
    Stage.CONVERTER,
    "A cracked address line of the multiplexer selects another sensor while the hand is closed (ours).",
    set_aside=True,
    touches="one",
    sizes=(0.02, 0.95),
)
def wrong_channel(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """At times, more often the more the hand is closed, the channel carries the next sensor's reading."""
    lasts_s = draws.one("lasts_s", 1.0, 3.0)
    closed = scene.closing[..., None] + 0.15 * _noise(scene, draws, "crack", 1, lasts_s)
    bend = (signal - scene.low) / scene.span
    other = np.roll(bend, 1, axis=-1) if signal.shape[-1] > 1 else scene.closing[..., None]
    return np.where((size > 0) & (closed > 1 - size), scene.low + scene.span * other, signal)


@form(
    Stage.CONVERTER,
    "Stretches of strong noise from a frayed conductor or shield, quiet in between (contact noise; ours).",
    set_aside=True,
    touches="one",
)
def crackle(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Noise that lasts a few frames, only while a slow random state of the conductor is bad."""
    channels = signal.shape[-1]
    lasts_s = draws.one("lasts_s", 2.0, 6.0)
    crackles_s = draws.one("crackles_s", 0.01, 0.08)
    bad = np.maximum(_noise(scene, draws, "state", channels, lasts_s) - 0.3, 0.0)
    return signal + size * 2 * bad * _noise(scene, draws, "crackle", channels, crackles_s)


FORMS = (floating_input, wrong_channel, crackle)
