"""Whether the order of a session and its postures can be told apart.

Where angles rise with time, as in a ramp of poses, a drift of the readings looks like posture: the regressor
learns it, and no effect finds it. The measure is how much of the time of the samples a rotation's angle
explains (R2 of a line), in all takes of a wearing together; the scale is what circularly shifted
sessions reach, which have the same motion and another order.

When training says that the order of a session and its postures cannot be told apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from glovecal_models.limit import limit
from glovecal_models.presentation.document import answer
from glovecal_models.takes.take import Take

SHIFTS = 199
NEAREST_SHIFT = 0.1
"""Of a stretch's samples: a session that is hardly shifted is the same one."""
SAMPLES_A_STRETCH = 400
"""At most: neighbouring frames say the same."""
FEWEST_SAMPLES = 20


@dataclass(frozen=True)
class TrainingLimits:
    """Of warnings; training is never refused by them."""

    confounded_r2: float = limit(
        0.7,
        "share of the variance of time",
        "A rotation whose angle explains as much of the time of its samples is confounded with their order.",
        "A drift asked for beside it has three times the variance. Two poses one after the other have 0.75; "
        "seven in random order stay below in 98 of 100 (2026-11-22).",
    )
    confounded_p: float = limit(
        0.01,
        "p value",
        "So few circularly shifted sessions may explain as much: slow free motion does by itself.",
        "One of 199 shifts; clean simulated sessions never came near either limit (2026-11-22).",
    )


TRAINING_LIMITS = TrainingLimits()


@answer
class OrderConfounding:
    """One rotation in one wearing."""

    wearing: str
    rotation: str
    r2: float
    """Share of the variance of time that the angle explains, 0 to 1."""
    shifted_r2: float
    """What 95 % of the circularly shifted sessions stay below."""
    p_value: float
    is_confounded: bool

    @property
    def inflation(self) -> float:
        """By how much the variance of a drift grows that is asked for beside the angle."""
        return 1.0 / max(1.0 - self.r2, 1e-9)


def order_confounding(
    takes: Sequence[Take], limits: TrainingLimits = TRAINING_LIMITS, *, seed: int = 0
) -> tuple[OrderConfounding, ...]:
    """Each measured rotation of each wearing, the most confounded first; ``seed`` is of the shifts.

    Takes of a wearing that were measured one after another on one clock are one stretch; others, such as
    files that each begin at zero, are stretches of their own.
    """
    random = np.random.default_rng(seed)
    found = []
    for wearing in dict.fromkeys(take.wearing for take in takes):
        own = [take for take in takes if take.wearing == wearing]
        for rotation in dict.fromkeys(name for take in own for name in take.rotations):
            stretches = _stretches(own, rotation)
            if sum(len(time_s) for time_s, _ in stretches) >= FEWEST_SAMPLES:
                found.append(_judged(wearing, rotation, stretches, random, limits))
    return tuple(sorted(found, key=lambda item: -item.r2))


_Stretch = tuple[np.ndarray, np.ndarray]
"""Times (n,), seconds, and angles (n,), degrees."""


def _stretches(takes: Sequence[Take], rotation: str) -> list[_Stretch]:
    parts: list[_Stretch] = []
    for take in takes:
        angles = take.reference_at_frames([rotation])[:, 0]
        known = np.isfinite(angles)
        if known.any():
            parts.append((take.time_s[known], angles[known]))
    parts.sort(key=lambda part: part[0][0])
    follow = all(earlier[0][-1] < later[0][0] for earlier, later in pairwise(parts))
    if follow and parts:
        parts = [(np.concatenate([t for t, _ in parts]), np.concatenate([a for _, a in parts]))]
    return [_thinned(part) for part in parts]


def _thinned(part: _Stretch) -> _Stretch:
    count = len(part[0])
    chosen = np.linspace(0, count - 1, min(count, SAMPLES_A_STRETCH)).round().astype(int)
    return part[0][chosen], part[1][chosen]


def _judged(
    wearing: str,
    rotation: str,
    stretches: Sequence[_Stretch],
    random: np.random.Generator,
    limits: TrainingLimits,
) -> OrderConfounding:
    time = np.concatenate([time_s - time_s.mean() for time_s, _ in stretches])
    own = [angle for _, angle in stretches]
    r2 = _explained(time, own)
    shifted = np.array([_explained(time, [_shifted(angle, random) for angle in own]) for _ in range(SHIFTS)])
    p_value = float((1 + np.count_nonzero(shifted >= r2 - 1e-12)) / (1 + SHIFTS))
    return OrderConfounding(
        wearing, rotation, r2, float(np.percentile(shifted, 95)), p_value,
        r2 >= limits.confounded_r2 and p_value <= limits.confounded_p,
    )  # fmt: skip


def _shifted(angles: np.ndarray, random: np.random.Generator) -> np.ndarray:
    share = random.uniform(NEAREST_SHIFT, 1.0 - NEAREST_SHIFT)
    return np.roll(angles, round(share * len(angles)))


def _explained(time: np.ndarray, angles: Sequence[np.ndarray]) -> float:
    """R2 of ``time`` (n,), centred in each stretch, by the angles with a mean for each stretch."""
    away = np.concatenate([part - part.mean() for part in angles])
    total = float(time @ time) * float(away @ away)
    return float(time @ away) ** 2 / total if total > 0.0 else 0.0
