"""When training says that the order of a session and its postures cannot be told apart."""

from __future__ import annotations

from dataclasses import dataclass

from glovecal_models.limit import limit


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
