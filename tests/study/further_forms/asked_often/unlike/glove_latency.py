"""Glove latency: polling that beats with the frames, a buffer that grows, and longer packets in motion."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import at_times


def _late(signal: np.ndarray, scene: Scene, delay: np.ndarray) -> np.ndarray:
    times = zip(signal, scene.time_s - delay, strict=True)
    return np.stack([at_times(scene.time_s, take, when) for take, when in times])


@form(
    Stage.TRANSPORT,
    "The host polls at nearly the glove's rate: the wait grows evenly and falls back (beat; ours).",
    only_by_name=True,
    shared=True,
    sizes=(0.002, 0.4),
)
def polling_beats_with_frames(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A fixed part and a sawtooth of the session time; size is the mean delay in seconds."""
    beats = scene.session_s / draws.one("beat_s", 4.0, 20.0) + draws.one("phase", 0.0, 1.0)
    return _late(signal, scene, size[0] * (0.5 + beats % 1.0))


@form(
    Stage.TRANSPORT,
    "A play-out buffer grows at once at each hiccup and shrinks again exponentially (Ramjee et al. 1994).",
    only_by_name=True,
    shared=True,
    sizes=(0.002, 0.4),
)
def buffer_grows_at_hiccups(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Half the size always, and as much again for each hiccup; size is about the mean delay in seconds."""
    apart, shrinks = draws.one("apart_s", 10.0, 25.0), draws.one("shrinks_s", 6.0, 15.0)
    keep = np.exp(-1 / (shrinks * scene.rate_hz))
    grown = np.zeros(signal.shape[:2])
    for take, start in enumerate(scene.starts):
        random = draws.stream("hiccups", start.key)
        hiccup = random.random(grown.shape[1]) < 1 / (apart * scene.rate_hz)
        grown[take] = lfilter([1.0], [1.0, -keep], hiccup * random.uniform(0.4, 1.2, len(hiccup)))
    return _late(signal, scene, size[0] * (0.5 + grown))


@form(
    Stage.TRANSPORT,
    "Differences are packed into as few bytes as they need: moving hands take longer (delta coding).",
    only_by_name=True,
    shared=True,
    sizes=(0.002, 0.4),
)
def longer_packets_in_motion(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A fixed part and one in proportion to the hand's mean speed of late; size is about the mean delay."""
    keep = np.exp(-1 / (draws.one("of_late_s", 0.2, 0.6) * scene.rate_hz))
    speed = np.abs(np.gradient(signal, axis=1)).mean(2) * scene.rate_hz
    of_late = lfilter([1 - keep], [1.0, -keep], speed, axis=1)
    return _late(signal, scene, size[0] * (0.4 + np.minimum(of_late / 40.0, 2.5)))


FORMS = (polling_beats_with_frames, buffer_grows_at_hiccups, longer_packets_in_motion)
