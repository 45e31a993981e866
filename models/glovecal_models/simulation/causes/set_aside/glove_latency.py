"""Glove latency: all channels of the glove come late together, by a time that stays the same.

A network of equal group delay, a receiver that plays packets back late, and a multiplexer that takes turns.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import bilinear, lfilter, lfilter_zi

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import at_times


@form(
    Stage.COUNTS,
    "A network that passes all frequencies and delays them alike (all-pass of Pade's approximants).",
    set_aside=True,
    sizes=(0.002, 0.4),
    shared=True,
)
def allpass_network(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Two equal second-order all-pass sections in a row, each with half of the delay."""
    half = size[0] / 2
    above, below = bilinear([half**2 / 12, -half / 2, 1.0], [half**2 / 12, half / 2, 1.0], fs=scene.rate_hz)
    late = signal
    for _ in range(2):
        settled = lfilter_zi(above, below)[None, :, None] * late[:, :1]
        late = lfilter(above, below, late, axis=1, zi=settled)[0]
    return np.asarray(late)


@form(
    Stage.TRANSPORT,
    "The receiver plays sparse packets back late, with straight lines between them (as games over networks).",
    set_aside=True,
    sizes=(0.002, 0.4),
    shared=True,
)
def interpolation_buffer(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """What is shown lies one delay back, on the straight line between the packets about that time."""
    spacing = max(size[0] * draws.one("spacing", 0.3, 0.5), 1 / scene.rate_hz)
    first = scene.time_s[0] - size[0] - spacing
    packets = np.arange(first, scene.time_s[-1] + spacing, spacing)
    late = np.empty_like(signal, dtype=float)
    for take in range(signal.shape[0]):
        for channel in range(signal.shape[2]):
            sent = np.interp(packets, scene.time_s, signal[take, :, channel])
            late[take, :, channel] = np.interp(scene.time_s - size[0], packets, sent)
    return late


@form(
    Stage.COUNTS,
    "A slow multiplexer reads the sensors in turn and sends when the round is done: late by place (ours).",
    set_aside=True,
    sizes=(0.002, 0.4),
    shared=True,
)
def scanned_in_turn(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Every reading is late; those read early in the round wait a little longer to be sent."""
    spread = draws.one("spread", 0.2, 0.4)
    places = np.linspace(1 + spread / 2, 1 - spread / 2, signal.shape[2])
    late = np.empty_like(signal)
    for take in range(signal.shape[0]):
        for channel, place in enumerate(places):
            times = scene.time_s - size[0] * place
            late[take, :, channel] = at_times(scene.time_s, signal[take, :, channel : channel + 1], times)[
                :, 0
            ]
    return late


FORMS = (allpass_network, interpolation_buffer, scanned_in_turn)
