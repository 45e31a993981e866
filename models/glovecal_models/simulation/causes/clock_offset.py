"""Clock offset: glove and reference stamp the same moment differently.

Here the reference is moved: a row stamped t shows the hand at t minus the offset, so that a positive offset
is a reference that comes late. Optical systems have 6 to 25 ms of latency (Qualisys; Santos, NIME 2021);
recordings started by hand differ by up to a second from take to take.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import at_times

SIZES_S = (0.002, 1.2)
LARGEST_S = 2.4


@form(
    Stage.CLOCK,
    "One time difference for the whole session (latency of an optical system; Santos, NIME 2021).",
    sizes=SIZES_S,
    shared=True,
)
def constant(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One offset of ``size`` seconds for the whole session."""
    return _late(signal, scene, np.full(scene.session_s.shape, draws.sign() * size[0]))


@form(
    Stage.CLOCK,
    "Another time difference in every take (recordings started one after the other by hand).",
    sizes=SIZES_S,
    shared=True,
)
def per_take(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Another offset in every take, around a common one."""
    common = draws.sign() * draws.one("common_share", 0.3, 1.0)
    own = np.array([draws.stream("take", start.key).standard_normal() for start in scene.starts])
    offset = np.clip(size[0] * (common + 0.7 * own), -LARGEST_S, LARGEST_S)
    return _late(signal, scene, np.broadcast_to(offset[:, None], scene.session_s.shape))


@form(
    Stage.CLOCK,
    "A time difference that grows over the session (crystals that differ by parts per million).",
    sizes=SIZES_S,
    shared=True,
)
def constant_and_drift(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """An offset that grows as one crystal runs faster than the other (20 to 100 parts per million)."""
    share = draws.sign() * draws.one("share_at_start", 0.2, 0.8)
    per_hour = draws.sign("drift_sign") * draws.one("drift_per_hour", 1.0, 2.5)
    offset = size[0] * (share + per_hour * scene.session_s / 3600)
    return _late(signal, scene, np.clip(offset, -LARGEST_S, LARGEST_S))


def _late(signal: np.ndarray, scene: Scene, offset_s: np.ndarray) -> np.ndarray:
    return np.stack(
        [
            at_times(scene.time_s, values, scene.time_s - offset)
            for values, offset in zip(signal, offset_s, strict=True)
        ]
    )


def _moved(signal: np.ndarray, scene: Scene, offset_s: np.ndarray) -> np.ndarray:
    """The signal read at other times, which differ by ``offset_s`` of shape (T, N)."""
    times = scene.time_s + offset_s
    return np.stack([at_times(scene.time_s, take, when) for take, when in zip(signal, times, strict=True)])


@form(
    Stage.CLOCK,
    "The clocks run apart and are set right again at even intervals (sawtooth of periodic syncing).",
    sizes=(0.002, 1.2),
    shared=True,
    only_by_name=True,
)
def resynchronised(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The difference grows from nothing to the size in seconds, then starts again."""
    period_s = draws.one("period_s", 12.0, 45.0)
    phase = draws.one("phase", 0.0, 1.0)
    grown = (scene.session_s / period_s + phase) % 1.0
    return _moved(signal, scene, draws.sign() * size[0] * grown)


@form(
    Stage.CLOCK,
    "Each take begins with a time difference that a clock servo pulls in (phase-locked loop; shape ours).",
    sizes=(0.002, 1.2),
    shared=True,
    only_by_name=True,
)
def pulled_in(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The difference begins each take with the size in seconds and falls exponentially to a small rest."""
    servo_s = draws.one("servo_s", 5.0, 20.0)
    rest = draws.one("rest", 0.0, 0.2)
    left = rest + (1 - rest) * np.exp(-np.maximum(scene.time_s, 0.0) / servo_s)
    return _moved(signal, scene, np.tile(draws.sign() * size[0] * left, (len(signal), 1)))


@form(
    Stage.CLOCK,
    "The time difference wanders to and fro (network time with a path delay that varies; shape ours).",
    sizes=(0.002, 1.2),
    shared=True,
    only_by_name=True,
)
def wandering(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The difference is a sum of three waves, slow enough that time never runs backwards."""
    waves = []
    for shortest_s in (13.0, 21.0, 34.0):
        turns = scene.session_s / draws.one(f"period_s_{shortest_s:g}", shortest_s, 1.4 * shortest_s)
        waves.append(np.sin(2 * np.pi * (turns + draws.one(f"phase_{shortest_s:g}", 0.0, 1.0))))
    return _moved(signal, scene, size[0] * 0.5 * np.sum(waves, axis=0))


FORMS = (
    constant,
    per_take,
    constant_and_drift,
    resynchronised,
    pulled_in,
    wandering,
)
