"""Repeated samples: a frame that did not arrive is filled with the one before.

Manus gloves in Motive run at 90 Hz without hardware synchronisation, "missing samples padded with the
previous" (docs.optitrack.com). Readings then are older than their stamps say, sometimes.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

BURSTS_PER_S = (0.2, 0.8)


@form(
    Stage.TRANSPORT,
    "Frames missing at random are filled with the one before (Manus in Motive, docs.optitrack.com).",
    sizes=(0.005, 0.97),
    shared=True,
)
def padded_at_random(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Every frame is missing with the same chance; the size is that chance."""
    return _held(signal, _chances(scene, draws) < size[0])


@form(
    Stage.TRANSPORT,
    "The glove is slower than the stream that carries it, so that frames repeat in a beat.",
    sizes=(1.02, 40.0),
    shared=True,
)
def periodic(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A glove slower than its stream: the size is the number of frames between fresh ones."""
    frames = np.arange(len(scene.time_s)) + draws.one("phase", 0.0, 1.0)
    fresh = np.diff(np.floor(frames / size[0]), prepend=-1) > 0
    return _held(signal, np.broadcast_to(~fresh, scene.session_s.shape))


@form(
    Stage.TRANSPORT,
    "The stream stands still for a while now and then (radio retransmission).",
    sizes=(0.02, 3.0),
    shared=True,
)
def bursts(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The stream stands still for a while and goes on; the size is how long, seconds, in the mean."""
    begins = _chances(scene, draws) < draws.one("per_s", *BURSTS_PER_S) / scene.rate_hz
    length = np.stack(
        [
            draws.stream("length", start.key).uniform(0.5, 1.5, len(scene.time_s)) * size[0] * scene.rate_hz
            for start in scene.starts
        ]
    )
    frames = np.arange(len(scene.time_s))
    ends = np.maximum.accumulate(np.where(begins, frames + length, -1.0), axis=1)
    return _held(signal, frames < ends)


def _chances(scene: Scene, draws: Draws) -> np.ndarray:
    """Shape (T, N), uniform 0 to 1; the same at every size, so that more size only adds repeats."""
    return np.stack([draws.stream("chance", start.key).random(len(scene.time_s)) for start in scene.starts])


def _held(signal: np.ndarray, missing: np.ndarray) -> np.ndarray:
    """Each missing frame, shape (T, N), replaced by the last one that is not."""
    frames = np.arange(signal.shape[1])
    last = np.maximum.accumulate(np.where(missing, 0, frames), axis=1)
    return np.take_along_axis(signal, last[:, :, None], axis=1)


@form(
    Stage.TRANSPORT,
    "A new frame is sent only once a joint has moved by some degrees (send-on-delta; Miskowicz 2006).",
    sizes=(0.1, 60.0),
    shared=True,
    only_by_name=True,
)
def sent_on_change(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Frames repeat until some joint is further than the size from where it was at the last new one."""
    step_deg = size[0] * draws.one("share", 0.8, 1.2)
    sent = scene.own[:, 0]
    fresh = np.zeros(signal.shape[:2], dtype=bool)
    for step in range(signal.shape[1]):
        fresh[:, step] = np.max(np.abs(scene.own[:, step] - sent), axis=-1) > step_deg
        sent = np.where(fresh[:, step, None], scene.own[:, step], sent)
    return _held(signal, ~fresh)


@form(
    Stage.TRANSPORT,
    "Frames are lost more often while the closed hand covers the antenna (body shadowing of 2.4 GHz links).",
    sizes=(0.005, 0.97),
    shared=True,
    only_by_name=True,
)
def shadowed_by_hand(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The chance of a lost frame, at most the size, goes with a sigmoid of how far the hand is closed."""
    covers = draws.one("covers", 0.25, 0.5)
    shadow = 0.05 + 0.95 / (1 + np.exp(-(scene.closing - covers) / 0.08))
    luck = [draws.stream("luck", start.key).random(signal.shape[1]) for start in scene.starts]
    return _held(signal, np.stack(luck) < size[0] * shadow)


@form(
    Stage.TRANSPORT,
    "The link falls back to halved rates and recovers in steps (rate adaptation of radio links; shape ours).",
    sizes=(0.02, 3.0),
    shared=True,
    only_by_name=True,
)
def rate_fallback(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """New frames come every size seconds, or a half, a quarter, ... of it, for seconds at a time."""
    lasts_s = draws.one("lasts_s", 3.0, 7.0)
    fresh = np.empty(signal.shape[:2], dtype=bool)
    for take, start in enumerate(scene.starts):
        random = draws.stream("levels", start.key)
        changes = np.cumsum(random.uniform(0.5 * lasts_s, 1.5 * lasts_s, 4000))
        halvings = random.integers(0, 5, 4001)[np.searchsorted(changes, scene.time_s - scene.time_s[0])]
        interval_s = np.maximum(size[0] * 0.5**halvings, 1 / scene.rate_hz)
        due = np.floor(np.cumsum(1 / (interval_s * scene.rate_hz)) + 1e-9)
        fresh[take] = np.diff(due, prepend=-1.0) > 0
    return _held(signal, ~fresh)


FORMS = (
    padded_at_random,
    periodic,
    bursts,
    sent_on_change,
    shadowed_by_hand,
    rate_fallback,
)
