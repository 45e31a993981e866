"""What stays of a model's effects when some of its rotations are learned anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.wanted_effect import WantedEffect


def kept_lanes(effects: Sequence[AddedEffect], relearned: Sequence[str]) -> list[AddedEffect]:
    """``effects`` without weight on the rotations learned anew; those left without any are dropped."""
    kept = []
    for item in effects:
        stays = np.array([name not in relearned for name in item.rotations])
        weights = np.where(stays[:, None], item.weights, 0.0)
        if weights.any():
            kept.append(replace(item, weights=weights))
    return kept


def columnless_effects(
    wanted: Sequence[WantedEffect], before: Sequence[AddedEffect] = ()
) -> list[AddedEffect]:
    """The effects among ``wanted`` that have settings only: repairs of the measurement, wider intervals.

    Those there were ``before`` keep their evidence.
    """
    evidence = {item.name: item.evidence for item in before}
    found = []
    for item in wanted:
        if not item.has_columns:
            nothing = np.zeros((len(item.rotations), 0))
            zero = np.zeros(len(item.rotations))
            known = evidence.get(item.name, {})
            found.append(AddedEffect(item.name, item.rotations, item.settings, nothing, nothing, zero, known))
    return found
