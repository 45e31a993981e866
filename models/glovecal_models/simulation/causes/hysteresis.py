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


@form(
    Stage.MECHANICAL,
    "A band over the knuckle slides only past a ratio of pulls that grows with its wrap (Euler's capstan).",
    only_by_name=True,
)
def capstan(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The band's far end stays put until the near end pulls stronger or weaker by the capstan's factor."""
    friction = draws.each("friction", 0.08, 0.3)
    pretension = draws.each("pretension", 0.1, 0.4)
    bend = np.clip((signal - scene.low) / scene.span, 0.0, 1.3)
    pull = bend + pretension
    grip = np.exp(friction * (0.2 + 1.6 * bend))
    slides_up, slides_down = pull / grip, pull * grip
    far = np.empty_like(pull)
    now = pull[:, 0]
    for step in range(pull.shape[1]):
        now = np.minimum(np.maximum(now, slides_up[:, step]), slides_down[:, step])
        far[:, step] = now
    return signal + size * 5 * (far - pull)


@form(
    Stage.MECHANICAL,
    "A state that runs after an S-curve of the angle with the path travelled (Coleman & Hodgdon 1986).",
    only_by_name=True,
)
def coleman_hodgdon(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The loop is open where the S-curve is steep and closed towards both ends of the range."""
    place = draws.each("place", 0.3, 0.7)
    width = draws.each("width", 0.15, 0.3)
    path = draws.each("path", 0.1, 0.25)
    bend = (signal - scene.low) / scene.span
    curve = np.tanh((bend - place) / width)
    forget = -np.expm1(-np.abs(np.diff(bend, axis=1)) / path)
    state = np.empty_like(bend)
    state[:, 0] = now = curve[:, 0]
    for step in range(1, bend.shape[1]):
        now = now + forget[:, step - 1] * (curve[:, step] - now)
        state[:, step] = now
    return signal + size * 2 * draws.signs() * (state - curve)


def _upper_branch(load: np.ndarray) -> np.ndarray:
    """The largest root x of x^3 - x = load, for loads of at least the lower fold."""
    ratio = np.maximum(load * 1.5 * np.sqrt(3), -1.0)
    inside = np.cos(np.arccos(np.minimum(ratio, 1.0)) / 3)
    outside = np.cosh(np.arccosh(np.maximum(ratio, 1.0)) / 3)
    return np.asarray(2 / np.sqrt(3) * np.where(ratio > 1, outside, inside))


@form(
    Stage.MECHANICAL,
    "A strip that buckles at one angle when closing and snaps back at a lower one (cusp of a buckled strip).",
    only_by_name=True,
)
def snap_through(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The strip stays on its branch of a cubic's equilibria until that branch ends."""
    place = draws.each("place", 0.35, 0.6)
    half_width = draws.each("half_width", 0.08, 0.18)
    fold = 2 / (3 * np.sqrt(3))
    load = fold * ((signal - scene.low) / scene.span - place) / half_width
    decided = np.abs(load) > fold
    decided[:, 0] = True
    frames = np.arange(load.shape[1])[:, None]
    last = np.maximum.accumulate(np.where(decided, frames, 0), axis=1)
    up = np.take_along_axis(load, last, axis=1) > 0
    buckled = np.where(up, _upper_branch(load), -_upper_branch(-load))
    return signal + size * draws.signs() * buckled


FORMS = (
    bouc_wen,
    single_play,
    several_plays,
    relays,
    capstan,
    coleman_hodgdon,
    snap_through,
)
