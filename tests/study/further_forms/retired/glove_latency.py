"""Glove latency: all channels of the glove come late by the same constant time.

A filter of flat group delay on the whole board, a link whose packets differ a little in their time of
travel, and a display that draws between two snapshots it already has: all of them delay, and delay alike.

A network of equal group delay, a receiver that plays packets back late, and a multiplexer that takes turns.

The time is settled at pairing, grows as a queue fills, or changes with the way the packets take.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import bessel, bilinear, freqs, lfilter, lfilter_zi

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import at_times

SIZES = (0.002, 0.4)


ORDER = 6


@form(
    Stage.COUNTS,
    "One analogue filter for the multiplexed signals, of the flattest group delay (Thomson 1949, Bessel).",
    only_by_name=True,
    sizes=SIZES,
    shared=True,
)
def flat_group_delay(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A Bessel low-pass of order six, whose delay at low frequencies is ``size`` seconds."""
    frames = signal.shape[1]
    numerator, denominator = bessel(ORDER, 1.0, analog=True, norm="delay")  # pyright: ignore
    # Mirrored at its end, the signal has no jump where the transform closes it to a ring.
    ring = np.concatenate([signal, signal[:, ::-1]], axis=1)
    rates = 2 * np.pi * np.fft.rfftfreq(2 * frames, 1 / scene.rate_hz)
    passed = freqs(numerator, denominator, rates * float(size.max()))[1]  # pyright: ignore
    return np.fft.irfft(np.fft.rfft(ring, axis=1) * passed[None, :, None], 2 * frames, axis=1)[:, :frames]


@form(
    Stage.TRANSPORT,
    "A radio link with a fixed time of travel and a little waiting that differs from frame to frame"
    " (CSMA; ours).",
    only_by_name=True,
    sizes=SIZES,
    shared=True,
)
def waits_for_the_channel(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Every frame comes late by a constant time, up to a tenth of it of waiting without memory."""
    late = np.empty(signal.shape)
    waiting = draws.one("waiting_share", 0.03, 0.12)
    for take, start in enumerate(scene.starts):
        waits = draws.stream("waits", start.key).beta(1.2, 3.0, len(scene.time_s))
        times = scene.time_s - float(size.max()) * (1.0 - waiting / 3 + waiting * waits)
        # Frames keep their order on the way.
        late[take] = at_times(scene.time_s, signal[take], np.maximum.accumulate(times))
    return late


@form(
    Stage.TRANSPORT,
    "Poses are drawn between the last two snapshots, always the same time ago (interpolation delay"
    " of engines).",
    only_by_name=True,
    sizes=SIZES,
    shared=True,
)
def between_snapshots(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Straight lines between snapshots a third to half a delay apart, shown one delay late."""
    delay = float(size.max())
    apart = max(delay * draws.one("apart_share", 0.3, 0.5), 1 / scene.rate_hz)
    shots = np.arange(scene.time_s[0], scene.time_s[-1], apart)
    then = np.clip(scene.time_s - delay, shots[0], shots[-1])
    place = np.clip(np.searchsorted(shots, then, side="right") - 1, 0, len(shots) - 2)
    share = ((then - shots[place]) / apart)[:, None]
    shown = [at_times(scene.time_s, one, shots) for one in signal]
    return np.stack([(1 - share) * shot[place] + share * shot[place + 1] for shot in shown])


@form(
    Stage.COUNTS,
    "A network that passes all frequencies and delays them alike (all-pass of Pade's approximants).",
    only_by_name=True,
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
    only_by_name=True,
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
    only_by_name=True,
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


@form(
    Stage.COUNTS,
    "Glove and receiver agree on a buffer each time they pair, so every wearing is late by its own time"
    " (ours).",
    only_by_name=True,
    sizes=(0.002, 0.4),
    shared=True,
)
def agreed_at_pairing(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One delay within each wearing, another one in the next."""
    share = [draws.stream("share", start.wearing).uniform(0.6, 1.5) for start in scene.starts]
    return _late(signal, scene, size[0] * np.array(share)[:, None])


@form(
    Stage.COUNTS,
    "Each hiccup of the reader leaves more in its queue, which is emptied only at the next start"
    " (bufferbloat).",
    only_by_name=True,
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
    only_by_name=True,
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


FORMS = (
    flat_group_delay,
    waits_for_the_channel,
    between_snapshots,
    allpass_network,
    interpolation_buffer,
    scanned_in_turn,
    agreed_at_pairing,
    queue_fills,
    by_way_of_second_node,
)
