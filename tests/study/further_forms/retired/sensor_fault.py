"""Sensor fault: one sensor or its wiring is broken and reads wrongly at times or all the time.

A cold solder joint sits in one of two states, a broken shield lets the mains in, and a cracked track parts
in some of the deep bends and not in others.

A defect in a contact switches to and fro, an amplifier begins to oscillate, a capacitor loses its charge.

One bit of its converter sticks, its wire touches the next one's, or sparks charge its input.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import lasting_noise


@form(
    Stage.CONVERTER,
    "A cold solder joint sits in one of two states and changes between them by itself (random"
    " telegraph signal).",
    only_by_name=True,
    touches="one",
)
def two_state_joint(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A fixed number of degrees is added for stretches that begin and end at random moments."""
    stays = draws.one("stays_s", 0.4, 2.5), draws.one("shifted_s", 0.4, 2.5)
    shifted = np.empty((*signal.shape[:2], 1))
    for take, start in enumerate(scene.starts):
        random = draws.stream("states", start.key)
        pairs = round(4 * (scene.time_s[-1] - scene.time_s[0]) / sum(stays))
        lengths = random.exponential(np.tile(stays, (pairs, 1)))
        changes = scene.time_s[0] + np.cumsum(lengths.ravel())
        shifted[take, :, 0] = np.searchsorted(changes, scene.time_s) % 2
    return signal + size * draws.sign() * 2.0 * shifted


@form(
    Stage.CONVERTER,
    "A broken shield lets the mains in, which the frame rate folds down to some hertz (aliased hum).",
    only_by_name=True,
    touches="one",
)
def hum_from_mains(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A sine of the mains' frequency with a weaker third harmonic, as frames happen to meet it."""
    mains = 2 * np.pi * draws.one("mains_hz", 49.93, 50.07)
    phase = draws.one("phase", 0.0, 2 * np.pi)
    third = draws.one("third", 0.1, 0.35)
    turned = mains * scene.session_s + phase
    hum = np.sin(turned) + third * np.sin(3 * turned)
    return signal + size * 1.4 * hum[:, :, None]


@form(
    Stage.CONVERTER,
    "A cracked track parts in some of the deep bends, by another resistance each time (crack in a"
    " bent conductor).",
    only_by_name=True,
    touches="one",
)
def crack_parts_in_bends(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The reading leaps while the joint is bent past the crack, in about half of the bends."""
    parts_at = draws.each("parts_at", 0.4, 0.55)
    apart = (scene.own - scene.low) / scene.span > parts_at
    bends = np.cumsum(np.diff(apart, axis=1, prepend=False) & apart, axis=1)
    leaps = np.zeros_like(signal)
    for take, start in enumerate(scene.starts):
        random = draws.stream("bends", start.key)
        heights = random.uniform(0.4, 1.6, (bends[take].max() + 1, signal.shape[2]))
        heights *= random.random(heights.shape) < 0.5
        leaps[take] = np.take_along_axis(heights, bends[take], axis=0)
    return signal + size * draws.sign() * 3.0 * np.where(apart, leaps, 0.0)


@form(
    Stage.CONVERTER,
    "A defect switches the reading to and fro between two levels at random (random telegraph noise).",
    only_by_name=True,
    touches="one",
)
def telegraph(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Two levels, each left again after a random time with a mean of its own."""
    high_s, low_s = draws.one("high_s", 0.4, 2.0), draws.one("low_s", 0.8, 4.0)
    raised = np.empty(signal.shape[:2])
    for row, start in enumerate(scene.starts):
        random = draws.stream("switches", start.key)
        stays = random.exponential(1.0, 2000) * np.tile([high_s, low_s], 1000)
        turn = np.searchsorted(np.cumsum(stays), scene.time_s - scene.time_s[0])
        raised[row] = turn % 2 == 0
    return signal + size * draws.sign() * 2 * raised[:, :, None]


@form(
    Stage.CONVERTER,
    "A loose capacitor lets the sensor's amplifier oscillate for stretches; sampled as a slow beat.",
    only_by_name=True,
    touches="one",
)
def oscillates(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A sine that grows, holds and dies away again, at a frequency of its own that shifts with the level."""
    beat_hz = draws.one("beat_hz", 1.5, 9.0)
    lasts_s, level = draws.one("lasts_s", 1.0, 3.0), draws.one("level", 0.2, 0.8)
    swing = np.empty(signal.shape[:2])
    for row, start in enumerate(scene.starts):
        random = draws.stream("bursts", start.key)
        loose = lasting_noise(random, len(scene.time_s), 1, lasts_s, scene.rate_hz)[:, 0]
        alive = np.clip((loose - level) / 0.2, 0, 1)
        swing[row] = alive * np.sin(2 * np.pi * beat_hz * scene.session_s[row] + 0.5 * loose)
    return signal + size * 3 * swing[:, :, None]


@form(
    Stage.CONVERTER,
    "A cracked capacitor loses its charge and is charged anew at random moments: uneven saw teeth (ours).",
    only_by_name=True,
    touches="one",
)
def loses_charge(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """After every charging the reading sinks away with one time until it is charged again."""
    every_s, sinks_s = draws.one("every_s", 2.0, 7.0), draws.one("sinks_s", 1.0, 6.0)
    sunk = np.empty(signal.shape[:2])
    for row, start in enumerate(scene.starts):
        random = draws.stream("charges", start.key)
        moments = np.cumsum(random.exponential(every_s, 400)) - every_s
        times = scene.time_s - scene.time_s[0]
        last = np.searchsorted(moments, times) - 1
        since = times - np.where(last < 0, 0.0, moments[np.maximum(last, 0)])
        sunk[row] = -np.expm1(-since / sinks_s)
    return signal + size * draws.sign() * 3 * sunk[:, :, None]


@form(
    Stage.CONVERTER,
    "One data line of the converter sticks at high for stretches, which adds its weight (stuck-at fault).",
    only_by_name=True,
    touches="one",
    sizes=(0.03, 20.0),
)
def bit_sticks(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Within stretches, the reading is too high by one bit's weight wherever that bit should be low."""
    weight = np.maximum(size, 1e-6)
    shift = draws.each("shift", 0.0, 1.0)
    low = np.floor(signal / weight + shift) % 2 == 0
    return signal + size * low * _failing(signal, scene, draws, draws.one("lasts_s", 1.5, 5.0))


@form(
    Stage.CONVERTER,
    "Worn insulation lets the wire touch that of the next sensor for stretches (short between two dividers).",
    only_by_name=True,
    touches="one",
)
def touches_next_wire(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Within stretches, the reading is drawn towards that of the next sensor."""
    place = np.arange(signal.shape[2])
    other = signal[:, :, np.where(place + 1 < len(place), place + 1, place - 1)]
    touching = _failing(signal, scene, draws, draws.one("lasts_s", 0.5, 3.0))
    return signal + size * 0.1 * touching * (other - signal)


@form(
    Stage.CONVERTER,
    "Sparks of dry cloth charge the input, and the charge leaks off within a second"
    " (electrostatic discharge).",
    only_by_name=True,
    touches="one",
)
def sparks(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """At random moments the reading is kicked up or down and comes back exponentially."""
    every, leaks = draws.one("every_s", 3.0, 8.0), draws.one("leaks_s", 0.3, 1.2)
    keep = np.exp(-1 / (leaks * scene.rate_hz))
    kicks = np.empty_like(signal)
    for take, start in enumerate(scene.starts):
        random = draws.stream("kicks", start.key)
        struck = random.random(kicks.shape[1:]) < 1 / (every * scene.rate_hz)
        kicks[take] = (
            struck * random.choice([-1.0, 1.0], struck.shape) * random.uniform(0.4, 1.6, struck.shape)
        )
    return signal + size * 4 * np.asarray(lfilter([1.0], [1.0, -keep], kicks, axis=1))


def _failing(signal: np.ndarray, scene: Scene, draws: Draws, lasts_s: float) -> np.ndarray:
    """1 in stretches of failure, 0 in those twice as long between them, for every sensor by itself."""
    failing = np.empty_like(signal)
    for take, start in enumerate(scene.starts):
        random = draws.stream("stretches", start.key)
        for sensor in range(signal.shape[2]):
            lengths = random.exponential([2 * lasts_s, lasts_s], (400, 2)).ravel()
            changes = scene.time_s[0] + lengths.cumsum()
            failing[take, :, sensor] = np.searchsorted(changes, scene.time_s) % 2
    return failing


FORMS = (
    two_state_joint,
    hum_from_mains,
    crack_parts_in_bends,
    telegraph,
    oscillates,
    loses_charge,
    bit_sticks,
    touches_next_wire,
    sparks,
)
