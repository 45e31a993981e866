"""Takes for the independence examination: one rotation kept still, or one alone through its range.

Joints move evenly (to and fro at constant speed), several at speeds without a common period: Wang & Neff
2013, section 3.1, "freely moving other speculative affecting sensors to the largest possible extent". The
palm's arch can be kept still too, as by a splint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.simulation.protocol import Segment, Unrest, posture_vector
from glovecal_models.simulation.simulated_glove import Performance, SimulatedGlove
from glovecal_models.simulation.simulated_hand import DRIVEN, POSTURES
from glovecal_models.takes.take import Take

SPEEDS_HZ = (0.31, 0.83)
ALONE_HZ = 0.25
REST_S = 0.5
PALM = "PALM_ARCH"
REFERENCE_NOISE_DEG = 0.7


@dataclass(frozen=True)
class EvenSweep:
    """Joints to and fro between the ends of their ranges at constant speed, from the low end on."""

    moving: tuple[str, ...]
    speed_hz: tuple[float, ...]
    duration_s: float

    def driven(self, time_s: np.ndarray) -> np.ndarray:
        angles = np.repeat(posture_vector(POSTURES["flat"])[None], len(time_s), axis=0)
        for name, speed in zip(self.moving, self.speed_hz, strict=False):
            angles[:, DRIVEN.index(name)] = _to_and_fro(name, speed, time_s)
        return angles

    def poses(self, time_s: np.ndarray) -> tuple[str, ...]:
        return ("",) * len(time_s)


def still_take(
    glove: SimulatedGlove,
    still: str | None,
    moving: Sequence[str],
    *,
    name: str,
    seconds: float = 20.0,
    with_reference: bool = False,
    rate_hz: float = 60.0,
    seed: int = 0,
) -> Take:
    """``moving`` go through their ranges at once, the rest of the hand stays flat.

    ``still`` is clamped (None: the hand itself holds the others, and wanders). Raises BadInput for a rotation
    that the hand cannot move by itself.
    """
    unknown = [one for one in moving if one not in (*DRIVEN, PALM)]
    if unknown:
        raise BadInput(f"{unknown[0]} does not move by itself; there are {', '.join((*DRIVEN, PALM))}")
    random = np.random.default_rng([seed, 15])
    speeds = np.linspace(*SPEEDS_HZ, len(moving)) if len(moving) > 1 else [ALONE_HZ]
    sweep = EvenSweep(tuple(name for name in moving if name != PALM), tuple(speeds), seconds)
    segment = Segment(name, sweep, Unrest(random, held=(still,) if still else ()))
    time = np.arange(round(seconds * rate_hz)) / rate_hz
    truth, _ = Performance(glove.hand, [segment], glove.rotations).at(time)
    if still is not None:
        truth[:, glove.rotations.index(still)] = truth[0, glove.rotations.index(still)]
    if PALM in moving:
        truth[:, glove.rotations.index(PALM)] = _to_and_fro(PALM, ALONE_HZ, time)
    random = np.random.default_rng([seed, 31, glove.wearing])
    readings = glove.readings(truth, random)
    take = Take(name, f"wearing-{glove.wearing}", glove.sensors, time, readings, simulated=True)
    if not with_reference:
        return take
    measured = truth + REFERENCE_NOISE_DEG * random.standard_normal(truth.shape)
    return replace(take, rotations=glove.rotations, reference_time_s=time, reference=measured)


def _to_and_fro(name: str, speed_hz: float, time_s: np.ndarray) -> np.ndarray:
    """Degrees, shape (N,): from the low end of a rotation's range to the high one and back, after a rest."""
    low, high = ACTIVE_RANGE_DEG[name]
    turn = speed_hz * np.maximum(time_s - REST_S, 0.0) % 1.0
    return low + (high - low) * (1 - np.abs(1 - 2 * turn))
