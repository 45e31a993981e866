"""Hysteresis: a reading depends on the way the joint came, not on how fast it came.

Sizes of 1 to 8 per cent of the range are reported for strain and bend sensors (PMC10810311, Table II;
Mattmann 2008, Sensors 8(6) 3719).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

RELAYS = 90


@form(
    Stage.MECHANICAL, "A force that follows every change of direction and levels off (Bouc 1967, Wen 1976)."
)
def bouc_wen(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A restoring force that follows the movement and levels off within ``width`` degrees."""
    width = draws.each("width_deg", 4.0, 14.0)
    power = draws.one("power", 1.0, 2.0)
    beta = draws.one("beta", 0.5, 0.8)
    step = np.diff(signal, axis=1, prepend=signal[:, :1]) / width
    force = np.zeros_like(signal)
    now = np.zeros(signal[:, 0].shape)
    for frame in range(signal.shape[1]):
        moved = step[:, frame]
        resisting = (1 - beta) + beta * np.sign(moved * now)
        now = np.clip(now + moved * (1 - resisting * np.abs(now) ** power), -1.0, 1.0)
        force[:, frame] = now
    return signal + size * width * force


@form(
    Stage.MECHANICAL,
    "One slack that has to be taken up before the sensor follows (backlash; Krasnoselskii & Pokrovskii).",
)
def single_play(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Cloth that moves along only after its slack is taken up."""
    radius = draws.each("radius_deg", 2.5, 9.0)
    return signal + size * (_plays(signal, [radius])[0] - signal)


@form(
    Stage.MECHANICAL,
    "Five slacks of different width in parallel (Prandtl-Ishlinskii, as in Rakotondrabe 2012).",
)
def several_plays(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A chain of slacks of different width: loops within loops."""
    result = signal.copy()
    total = 0.0
    radii = [draws.each(f"radius_{number}_deg", low, high) for number, (low, high) in enumerate(
        ((0.8, 2.0), (2.0, 4.5), (4.5, 9.0), (9.0, 15.0), (15.0, 24.0))
    )]  # fmt: skip
    weights = [draws.each(f"weight_{number}", 0.1, 1.0) for number in range(len(radii))]
    total = np.sum(weights, axis=0)
    for play, weight in zip(_plays(signal, radii), weights, strict=True):
        result += size * weight / total * (play - signal)
    return result


@form(
    Stage.MECHANICAL,
    "Ninety switches with their own closing and opening angles (Preisach 1935).",
)
def relays(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Many small switches, each closing at one angle and opening at a lower one (Preisach)."""
    random = draws.stream("relays")
    count = signal.shape[2]
    gap = draws.each("mean_gap_deg", 5.0, 14.0)
    middle = (np.arange(RELAYS) + random.uniform(0, 1, (count, RELAYS))) / RELAYS
    middle = scene.low[:, None] + scene.span[:, None] * middle
    half = gap[:, None] * random.gamma(3.0, 1 / 3.0, (count, RELAYS)) / 2
    closes, opens = middle + half, middle - half
    share = (scene.span / RELAYS)[:, None]
    state = (signal[:, 0, :, None] > middle).astype(float)
    bent = np.empty_like(signal)
    for frame in range(signal.shape[1]):
        now = signal[:, frame, :, None]
        state[now >= closes] = 1.0
        state[now <= opens] = 0.0
        bent[:, frame] = (state * share).sum(axis=-1)
    return signal + size * (scene.low + bent - signal)


def _plays(signal: np.ndarray, radii: Sequence[np.ndarray]) -> np.ndarray:
    """Followers (K, takes, frames, sensors) of ``signal`` with K slacks: all in one walk over the frames."""
    frames = np.moveaxis(signal, 1, 0)[:, None]
    radius = np.array(radii)[:, None, :]
    above, below = frames + radius, frames - radius
    followers = np.empty_like(above)
    before = np.broadcast_to(frames[0], above.shape[1:])
    for high, low, now in zip(above, below, followers, strict=True):
        np.minimum(high, before, out=now)
        np.maximum(low, now, out=now)
        before = now
    return np.moveaxis(followers, 0, 2)


FORMS = (bouc_wen, single_play, several_plays, relays)
