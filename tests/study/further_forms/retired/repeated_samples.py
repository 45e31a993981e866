"""Repeated samples: frames that bring nothing new, because the newest reading is shown again.

Frames are lost by the packet, fingers are read in turn so that each is old for a while, or the receiver
pauses at even intervals to tidy up.

A housekeeping task holds the stream up, a driver refuses what it thinks impossible, or hops fail.

While the radio signal fades, while a buffer is played in a loop, or when packets arrive out of order.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import lasting_noise


@form(
    Stage.TRANSPORT,
    "Several frames travel in one packet; a packet that is lost leaves the last frame shown all its"
    " time (ours).",
    only_by_name=True,
    sizes=(0.005, 0.97),
    shared=True,
)
def whole_packets_lost(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Repeats come in runs of whole packets, each of which is lost with the same chance."""
    frames = signal.shape[1]
    per_packet = round(draws.one("frames_per_packet", 4.0, 12.0))
    packet = np.arange(frames) // per_packet
    new = np.empty(signal.shape[:2], dtype=bool)
    for take, start in enumerate(scene.starts):
        chance = draws.stream("packets", start.key).random(packet[-1] + 1)
        new[take] = chance[packet] >= float(size.max())
    return _hold(signal, np.repeat(new[:, :, None], signal.shape[2], axis=2))


@form(
    Stage.TRANSPORT,
    "Sensors are read in turn and the others sent again as they were (round-robin scan of a slow converter).",
    only_by_name=True,
    sizes=(1.02, 40.0),
    shared=True,
)
def sensors_take_turns(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor is new once in ``size`` frames, each at another moment of the round."""
    frames, channels = signal.shape[1:]
    turn = np.arange(channels) / channels + draws.one("first_turn", 0.0, 1.0)
    rounds = np.floor(np.arange(frames)[:, None] / float(size.max()) + turn)
    new = np.diff(rounds, axis=0, prepend=rounds[:1] - 1) > 0
    return _hold(signal, np.broadcast_to(new, signal.shape))


@form(
    Stage.TRANSPORT,
    "The receiver stands still at even intervals, as long each time (garbage collection of a"
    " managed runtime).",
    only_by_name=True,
    sizes=(0.02, 3.0),
    shared=True,
)
def regular_pauses(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Pauses of ``size`` seconds begin every few seconds by the session's clock."""
    every = draws.one("every_s", 3.2, 6.0)
    since = np.mod(scene.session_s + draws.one("first_s", 0.0, 6.0), every)
    new = since >= float(size.max())
    return _hold(signal, np.repeat(new[:, :, None], signal.shape[2], axis=2))


def _hold(signal: np.ndarray, new: np.ndarray) -> np.ndarray:
    """The signal where ``new``, elsewhere the newest value before, for each sensor on its own."""
    frames = np.arange(signal.shape[1])[None, :, None]
    newest = np.maximum.accumulate(np.where(new, frames, 0), axis=1)
    return np.take_along_axis(signal, newest, axis=1)


@form(
    Stage.TRANSPORT,
    "A housekeeping task of the receiver holds the stream up at even intervals (garbage collection, disk).",
    only_by_name=True,
    sizes=(0.02, 3.0),
    shared=True,
)
def housekeeping(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The stream stands still for a set time, runs for a set time, and so on."""
    runs_s = draws.one("runs_s", 0.5, 1.6)
    phase = (scene.session_s + draws.one("phase_s", 0.0, 5.0)) % (runs_s + size[0])
    return _held(signal, phase >= size[0])


@form(
    Stage.TRANSPORT,
    "The driver refuses frames too far from the last one taken, for a while (plausibility check; ours).",
    only_by_name=True,
    sizes=(0.02, 3.0),
    shared=True,
)
def refused_as_implausible(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A frame is refused if any joint jumped too far; after a while the next frame is taken anyway."""
    limit_deg = draws.one("limit_deg", 1.5, 3.0)
    # A patience between two frames is now the shorter, now the longer, so that it grows evenly.
    part = np.stack([draws.stream("part", start.key).random(len(scene.time_s)) for start in scene.starts])
    fresh = np.ones(signal.shape[:2], dtype=bool)
    last, waited = scene.own[:, 0], np.zeros(signal.shape[0])
    for frame in range(1, signal.shape[1]):
        now = scene.own[:, frame]
        near = np.abs(now - last).max(axis=1) <= limit_deg
        taken = near | (waited + part[:, frame] >= size[0] * scene.rate_hz)
        last = np.where(taken[:, None], now, last)
        waited = np.where(taken, 0, waited + 1)
        fresh[:, frame] = taken
    return _held(signal, fresh)


@form(
    Stage.TRANSPORT,
    "The link hops over 37 channels, some of them busy, so that the same hops fail in every round (BLE).",
    only_by_name=True,
    sizes=(0.005, 0.97),
    shared=True,
)
def busy_hops(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Frames sent on a busy channel are lost; which ones repeats every 37 frames."""
    channels = 37
    hop = int(draws.one("hop", 5.0, 16.99))
    rank = draws.stream("busy").permutation(channels)
    frame = np.round(scene.session_s * scene.rate_hz).astype(int)
    # The channel at the edge is busy for a part of its frames, so that the loss grows evenly with the size.
    edge = np.stack([draws.stream("edge", start.key).random(len(scene.time_s)) for start in scene.starts])
    return _held(signal, rank[(frame * hop) % channels] + edge >= size[0] * channels)


def _held(signal: np.ndarray, fresh: np.ndarray) -> np.ndarray:
    """Every frame (T, N) that is not fresh shows the last one that was."""
    last = np.maximum.accumulate(np.where(fresh, np.arange(fresh.shape[1]), 0), axis=1)
    return np.take_along_axis(signal, last[:, :, None], axis=1)


@form(
    Stage.TRANSPORT,
    "Echoes cancel the radio signal now and then, and the last frame is shown on"
    " (fading; Rayleigh, Clarke 1968).",
    only_by_name=True,
    sizes=(0.005, 0.97),
    shared=True,
)
def signal_fades(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Frames are lost while the strength of two noisy parts of the signal together is below a level."""
    lasts = draws.one("lasts_s", 0.15, 0.5)
    frames = signal.shape[1]
    lost = np.empty(signal.shape[:2], dtype=bool)
    for take, start in enumerate(scene.starts):
        parts = lasting_noise(draws.stream("echoes", start.key), frames, 2, lasts, scene.rate_hz)
        lost[take] = (parts**2).sum(axis=1) / 2 < -np.log1p(-size[0])
    return _shown(signal, np.maximum.accumulate(np.where(lost, 0, np.arange(frames)), axis=1))


@form(
    Stage.TRANSPORT,
    "When no data come, the driver plays its ring buffer again and again (as stuttering sound does).",
    only_by_name=True,
    sizes=(0.02, 3.0),
    shared=True,
)
def ring_buffer_again(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """In each pause of the link, up to some tenths of a second before it come again in a loop."""
    apart, pause = draws.one("apart_s", 1.5, 3.5), max(round(size[0] * scene.rate_hz), 1)
    ring = min(max(round(draws.one("ring_s", 0.1, 0.4) * scene.rate_hz), 2), pause)
    frames = signal.shape[1]
    shown = np.tile(np.arange(frames), (len(signal), 1))
    for take, start in enumerate(scene.starts):
        gaps = draws.stream("gaps", start.key).exponential(apart, frames) * scene.rate_hz
        first = ring
        for gap in gaps:
            first += int(gap)
            if first >= frames:
                break
            many = np.arange(min(pause, frames - first))
            shown[take, first + many] = first - ring + many % ring
            first += pause
    return _shown(signal, shown)


@form(
    Stage.TRANSPORT,
    "Some packets take a longer way and overwrite newer ones on arrival (UDP does not keep order; RFC 768).",
    only_by_name=True,
    sizes=(0.02, 3.0),
    shared=True,
)
def out_of_order(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Single frames among new ones are older by a time that differs from one to the next."""
    share = draws.one("share", 0.12, 0.3)
    frames = signal.shape[1]
    shown = np.empty(signal.shape[:2], dtype=int)
    for take, start in enumerate(scene.starts):
        random = draws.stream("packets", start.key)
        age = np.ceil(size[0] * scene.rate_hz * random.uniform(0.4, 1.0, frames))
        late = random.random(frames) < share
        shown[take] = np.maximum(np.arange(frames) - np.where(late, age, 0.0), 0).astype(int)
    return _shown(signal, shown)


def _shown(signal: np.ndarray, frame: np.ndarray) -> np.ndarray:
    return np.take_along_axis(signal, frame[:, :, None], axis=1)


FORMS = (
    whole_packets_lost,
    sensors_take_turns,
    regular_pauses,
    housekeeping,
    refused_as_implausible,
    busy_hops,
    signal_fades,
    ring_buffer_again,
    out_of_order,
)
