"""Set-aside forms of a stream in which frames hold the readings of an earlier frame."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def _held(signal: np.ndarray, fresh: np.ndarray) -> np.ndarray:
    """The signal with every frame that is not fresh, shape (T, N), filled with the last fresh one."""
    last = np.maximum.accumulate(np.where(fresh, np.arange(fresh.shape[1]), 0), axis=1)
    return np.take_along_axis(signal, last[..., None], axis=1)


@form(
    Stage.TRANSPORT,
    "A new frame is sent only once a joint has moved by some degrees (send-on-delta; Miskowicz 2006).",
    set_aside=True,
    sizes=(0.1, 60.0),
    shared=True,
)
def sent_on_change(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Frames repeat until some joint is further than the size from where it was at the last new one."""
    step_deg = size[0] * draws.one("share", 0.8, 1.2)
    sent = scene.own[:, 0]
    fresh = np.zeros(signal.shape[:2], dtype=bool)
    for step in range(signal.shape[1]):
        fresh[:, step] = np.max(np.abs(scene.own[:, step] - sent), axis=-1) > step_deg
        sent = np.where(fresh[:, step, None], scene.own[:, step], sent)
    return _held(signal, fresh)


@form(
    Stage.TRANSPORT,
    "Frames are lost more often while the closed hand covers the antenna (body shadowing of 2.4 GHz links).",
    set_aside=True,
    sizes=(0.005, 0.97),
    shared=True,
)
def shadowed_by_hand(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The chance of a lost frame, at most the size, goes with a sigmoid of how far the hand is closed."""
    covers = draws.one("covers", 0.25, 0.5)
    shadow = 0.05 + 0.95 / (1 + np.exp(-(scene.closing - covers) / 0.08))
    luck = [draws.stream("luck", start.key).random(signal.shape[1]) for start in scene.starts]
    return _held(signal, np.stack(luck) >= size[0] * shadow)


@form(
    Stage.TRANSPORT,
    "The link falls back to halved rates and recovers in steps (rate adaptation of radio links; shape ours).",
    set_aside=True,
    sizes=(0.02, 3.0),
    shared=True,
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
    return _held(signal, fresh)


FORMS = (sent_on_change, shadowed_by_hand, rate_fallback)
