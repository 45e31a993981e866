"""Held-out folds: whole takes, or stretches of time when there is one take; never random frames.

Neighbouring frames are alike, so a model scored on random frames is scored on what it has seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

STRETCHES = 8


@dataclass(frozen=True)
class Fold:
    """Which samples are left out, as a boolean mask of shape (N,), and what they are in words."""

    held_out: np.ndarray
    sentence: str


def folds_over_takes(take: np.ndarray, count: int) -> list[Fold]:
    """Up to ``count`` folds that together leave out every sample once.

    ``take`` (N,) is each sample's take index, samples of a take in order of time. With a single take its
    time is cut into stretches, dealt to the folds in turn.
    """
    if count < 1 or len(take) == 0:
        return []
    owners = np.unique(take)
    if len(owners) > 1:
        groups = [owners[start::count] for start in range(min(count, len(owners)))]
        return [Fold(np.isin(take, group), f"{len(group)} of {len(owners)} takes") for group in groups]
    stretch = np.minimum(np.arange(len(take)) * STRETCHES // len(take), STRETCHES - 1)
    return [
        Fold((stretch % count) == fold, f"stretches of the only take, one in {count}")
        for fold in range(count)
    ]
