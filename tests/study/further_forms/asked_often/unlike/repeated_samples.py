"""Repeated samples: low priorities wait, airtime runs out, and a drawing loop fetches at uneven times."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.TRANSPORT,
    "Each sensor sends messages of its own on a busy bus, where low priorities wait (CAN, ISO 11898).",
    only_by_name=True,
    shared=True,
    sizes=(0.005, 1.0),
)
def low_priorities_wait(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is the mean wait in seconds of the lowest priority; the highest waits half as long."""
    _, frames, sensors = signal.shape
    rank = draws.stream("ranks").permutation(np.linspace(0.5, 1.0, sensors))
    gets_through = 1 / (1 + size * rank * scene.rate_hz)
    chances = [draws.stream("bus", start.key).random((frames, sensors)) for start in scene.starts]
    fresh = np.where(np.stack(chances) < gets_through, np.arange(frames)[:, None], 0)
    return np.take_along_axis(signal, np.maximum.accumulate(fresh, axis=1), axis=1)


@form(
    Stage.TRANSPORT,
    "A radio may send only so long, while airtime saved at rest lasts (token bucket; ETSI EN 300 220).",
    only_by_name=True,
    shared=True,
    sizes=(0.01, 0.8),
)
def airtime_runs_out(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is what a frame costs, in seconds of saving; frames in which nothing moved are not sent."""
    most, moved_deg = draws.one("saved_s", 1.0, 3.0), draws.one("moved_deg", 0.8, 2.0)
    cost = float(size[0])
    saved, sent, out = np.full(len(signal), most), signal[:, 0], np.empty_like(signal)
    for frame in range(signal.shape[1]):
        saved = np.minimum(saved + 1 / scene.rate_hz, max(most, cost))
        moved = np.abs(signal[:, frame] - sent).max(1) > moved_deg
        goes = moved & (saved >= cost)
        saved = np.where(goes, saved - cost, saved)
        sent = np.where(goes[:, None], signal[:, frame], sent)
        out[:, frame] = sent
    return out


@form(
    Stage.TRANSPORT,
    "A program fetches the glove once per picture, which takes unevenly long (log-normal times; ours).",
    only_by_name=True,
    shared=True,
    sizes=(0.005, 1.0),
)
def drawing_loop_fetches(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is the median time from picture to picture in seconds, at least one frame."""
    spread, out = draws.one("spread", 0.6, 1.1), np.empty_like(signal)
    for take, start in enumerate(scene.starts):
        uneven = np.exp(spread * draws.stream("pictures", start.key).standard_normal(signal.shape[1]))
        drawn = np.concatenate([[0.0], np.cumsum(np.maximum(np.rint(size[0] * uneven * scene.rate_hz), 1.0))])
        frames = np.arange(signal.shape[1])
        out[take] = signal[take, drawn[np.searchsorted(drawn, frames, side="right") - 1].astype(int)]
    return out


FORMS = (low_priorities_wait, airtime_runs_out, drawing_loop_fetches)
