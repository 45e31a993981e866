"""Takes recorded from a simulated hand in a simulated glove, with the truth beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.simulation.performance import Performance, duration_s
from glovecal_models.simulation.protocol import Segment
from glovecal_models.simulation.simulated_glove import SimulatedGlove
from glovecal_models.takes.take import Take

REFERENCE_NOISE_DEG = 0.7
NOT_MEASURED = ("PALM_ARCH",)
"""No reference system measures the palm's arch, so simulated takes have no reference for it."""


@dataclass(frozen=True)
class SimulatedTake:
    """A take as a recorder would keep it, and what the hand really did."""

    take: Take
    truth: np.ndarray
    """Shape (N, R), degrees, in the order of the layout's rotations, without measurement noise."""


def simulate_take(
    glove: SimulatedGlove,
    motion: Segment | Sequence[Segment],
    *,
    seed: int = 0,
    rate_hz: float = 120.0,
    reference_noise_deg: float = REFERENCE_NOISE_DEG,
    name: str | None = None,
) -> SimulatedTake:
    """Record one segment, or several moving from each into the next, marked as simulated.

    The reference is measured at the frames' times with independent noise. The same arguments give the
    same take, whatever else was recorded from ``glove``. Raises BadInput when there is nothing to record.
    """
    segments = [motion] if isinstance(motion, Segment) else list(motion)
    if not segments or not rate_hz > 0:
        raise BadInput(f"nothing to record: {len(segments)} segments at {rate_hz:g} Hz")
    time = np.arange(max(round(duration_s(segments) * rate_hz), 1)) / rate_hz
    truth, poses = Performance(glove.hand, segments, glove.rotations).at(time)
    random = np.random.default_rng([seed, 30, glove.wearing])
    readings = glove.readings(truth, random)
    measured = measured_rotations(glove)
    columns = [glove.rotations.index(rotation) for rotation in measured]
    take = Take(
        name=name or "-".join(dict.fromkeys(segment.name for segment in segments)),
        wearing=f"wearing-{glove.wearing}",
        sensors=glove.sensors,
        time_s=time,
        readings=readings,
        rotations=measured,
        reference_time_s=time,
        reference=truth[:, columns]
        + reference_noise_deg * random.standard_normal((len(truth), len(columns))),
        poses=poses if any(poses) else None,
        simulated=True,
    )
    return SimulatedTake(take, truth)


def measured_rotations(glove: SimulatedGlove) -> tuple[str, ...]:
    """Rotations a simulated take has a reference for."""
    return tuple(rotation for rotation in glove.rotations if rotation not in NOT_MEASURED)
