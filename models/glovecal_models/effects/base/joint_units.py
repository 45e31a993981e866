"""Joints in their own standard deviations, so that gains of all joints are of one size."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.signals import Signals
from glovecal_models.errors import BadInput


def fit_joint_units(takes: Sequence[Signals]) -> Settings:
    """Centre and scale of each lane, degrees, to be stored with an effect's settings.

    Takes without a row say nothing; at least one has some.
    """
    own = [take.own for take in takes if len(take)]
    return {
        "own_centre_deg": np.mean([part.mean(axis=0) for part in own], axis=0).tolist(),
        "own_scale_deg": np.sqrt(np.mean([part.var(axis=0) for part in own], axis=0)).tolist(),
    }


def in_joint_units(own: np.ndarray, settings: Settings) -> np.ndarray:
    """(..., L) standard deviations from the centre; lanes may be the settled ones several times over."""
    lanes = own.shape[-1]
    scale = on_lanes(settings["own_scale_deg"], lanes)
    return (own - on_lanes(settings["own_centre_deg"], lanes)) / np.maximum(scale, 1e-6)


def on_lanes(settled: Sequence[float], lanes: int) -> np.ndarray:
    """(lanes,): the settled values, repeated as a whole while several shapes are tried at once.

    Raises BadInput when ``lanes`` is not a multiple of what was settled.
    """
    if lanes % len(settled):
        raise BadInput(f"settings of {len(settled)} lanes were given signals of {lanes}; settle them anew")
    return np.tile(settled, lanes // len(settled))
