"""An effect that a model has already: part of the base while another one is looked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.signals import Signals


@dataclass(frozen=True)
class KnownEffect:
    """An effect with its shapes; its constants are settled and its weights fitted anew with the base."""

    effect: Effect
    joints: tuple[str, ...]
    shapes: tuple[np.ndarray, ...]
    """For each joint (P,)."""

    def columns(self, takes: Sequence[Signals], lane: int, joint: str) -> list[np.ndarray] | None:
        """For each take (N, C) of one joint, a lane of ``takes``; None when it is not concerned."""
        if joint not in self.joints:
            return None
        single = [one_lane(take, lane) for take in takes]
        settings = self.effect.fit_constants(single)
        shape = self.shapes[self.joints.index(joint)][None, :]
        return [self.effect.columns(take, settings, shape)[:, 0, :] for take in single]


def known_effects(model: CalibrationModel) -> tuple[KnownEffect, ...]:
    """One for each effect of a model; those without columns only are not looked for again."""
    found = []
    for item in model.effects:
        active = item.active if item.weights.shape[1] else ()
        shapes = tuple(item.shape[item.rotations.index(name)] for name in active)
        found.append(KnownEffect(item.effect, active, shapes))
    return tuple(found)


def one_lane(take: Signals, lane: int) -> Signals:
    """The signals of one joint alone."""
    zero = None if take.zero_deg is None else take.zero_deg[[lane]]
    return replace(take, own=take.own[:, [lane]], zero_deg=zero)
