"""Glove latency: all readings come late by the same time, without being smoothed.

The time is settled at pairing, grows as a queue fills, or changes with the way the packets take.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import at_times


@form(
    Stage.COUNTS,
    "Glove and receiver agree on a buffer each time they pair, so every wearing is late by its own time (ours).",
    set_aside=True,
    sizes=(0.002, 0.4),
    shared=True,
)
def agreed_at_pairing(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One delay within each wearing, another one in the next."""
    share = [draws.stream("share", start.wearing).uniform(0.6, 1.5) for start in scene.starts]
    return _late(signal, scene, size[0] * np.array(share)[:, None])


@form(
    Stage.COUNTS,
    "Each hiccup of the reader leaves more in its queue, which is emptied only at the next start (bufferbloat).",
    set_aside=True,
    sizes=(0.002, 0.4),
    shared=True,
)
def queue_fills(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The delay begins alike in all takes and grows by a notch at random moments."""
    every, notch = draws.one("every_s", 7.0, 14.0), draws.one("notch", 0.12, 0.25)
    moments = [draws.stream("moments", start.key).exponential(every, 8).cumsum() for start in scene.starts]
    hiccups = np.stack([np.searchsorted(take, scene.time_s) for take in moments])
    return _late(signal, scene, size[0] * (0.7 + notch * hiccups))


@form(
    Stage.COUNTS,
    "At times packets reach the receiver only by way of a second node and take longer (mesh network).",
    set_aside=True,
    sizes=(0.002, 0.4),
    shared=True,
)
def by_way_of_second_node(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The delay changes between two values, each of which lasts for seconds."""
    longer, lasts = draws.one("longer", 1.4, 2.2), draws.one("lasts_s", 4.0, 10.0)
    delay = np.empty((signal.shape[0], signal.shape[1]))
    for take, start in enumerate(scene.starts):
        changes = scene.time_s[0] + draws.stream("changes", start.key).exponential(lasts, 80).cumsum()
        indirect = np.searchsorted(changes, scene.time_s) % 2 == 1
        delay[take] = np.where(indirect, longer, 0.7)
    return _late(signal, scene, size[0] * delay)


def _late(signal: np.ndarray, scene: Scene, delay_s: np.ndarray) -> np.ndarray:
    """All sensors as they were a delay ago, given for every take and time."""
    moved = zip(signal, scene.time_s - delay_s, strict=True)
    return np.stack([at_times(scene.time_s, take, times) for take, times in moved])


FORMS = (agreed_at_pairing, queue_fills, by_way_of_second_node)
