"""An effect that a model has already: part of the base while another one is looked for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.effects.catalogue import effect
from glovecal_models.effects.effect import Settings, Signals


@dataclass(frozen=True)
class KnownEffect:
    """An effect with its constants and shapes; its weights are fitted anew with the base."""

    name: str
    joints: tuple[str, ...]
    settings: tuple[Settings, ...]
    """For each joint."""
    shapes: tuple[np.ndarray, ...]
    """For each joint (P,)."""

    def columns(self, take: Signals, lane: int, joint: str) -> np.ndarray | None:
        """(N, C) of one joint whose signal is a lane of ``take``; None when it is not concerned."""
        if joint not in self.joints:
            return None
        at = self.joints.index(joint)
        single = replace(
            take,
            own=take.own[:, [lane]],
            zero_deg=None if take.zero_deg is None else take.zero_deg[[lane]],
        )
        return effect(self.name).columns(single, self.settings[at], self.shapes[at][None, :])[:, 0, :]
