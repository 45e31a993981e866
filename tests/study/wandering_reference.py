"""A reference that wanders slowly, as markers that shift on the skin make it; the glove has no part in it."""

from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np

from glovecal_models.takes.take import Take

WANDER_DEG = 0.5
"""RMS in each take and rotation."""
WAVES = 4
PERIODS_S = (10.0, 80.0)
"""The longest are longer than a take: an offset of the take, and a trend in it."""


def with_wander(take: Take, seed: int) -> Take:
    """A sum of slow sines on each rotation of the reference, of its own in each take.

    The same seed and name of the take give the same wander, so that a clean twin has it too.
    """
    if not len(take.reference_time_s):
        return take
    random = np.random.default_rng([seed, zlib.crc32(take.name.encode())])
    shape = (WAVES, len(take.rotations))
    periods, phases = random.uniform(*PERIODS_S, shape), random.uniform(0, 2 * np.pi, shape)
    time = (take.reference_time_s - take.reference_time_s[0])[:, None, None]
    wander = np.sin(2 * np.pi * time / periods + phases).sum(axis=1)
    wander *= WANDER_DEG / np.sqrt(np.mean(wander**2, axis=0))
    return replace(take, reference=take.reference + wander)
