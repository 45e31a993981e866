"""Effects that add no columns: the calibration stays as it is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from glovecal_models.effects.base.effect import InstantEffect
from glovecal_models.effects.base.facts import Control, Settings
from glovecal_models.effects.base.signals import Signals


class ColumnlessEffect(InstantEffect):
    """Zero columns, one shape of zeros."""

    control: ClassVar[Control] = "none"

    def grid(self, takes: Sequence[Signals], settings: Settings) -> np.ndarray:
        return np.zeros((1, takes[0].own.shape[1], len(self.parameters)))

    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        return np.zeros((len(take), take.own.shape[1], 0))

    def weight_names(self, settings: Settings) -> tuple[str, ...]:
        return ()
