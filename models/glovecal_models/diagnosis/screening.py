"""Every effect of the catalogue on every joint, in both directions, beside its decoy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.calibration.held_out import HeldOut, held_out
from glovecal_models.diagnosis.directions import Direction
from glovecal_models.effects.base.decoy import decoy_columns
from glovecal_models.effects.base.effect import Effect, Settings, Signals


@dataclass(frozen=True)
class Evidence:
    """What one effect saves on one joint in one direction."""

    true: HeldOut
    decoy: HeldOut
    shape: np.ndarray
    """(P,) of the best."""
    settings: Settings

    @property
    def contrast(self) -> float:
        """Share of the squared error saved beyond what the decoy saves."""
        return self.true.saved - max(self.decoy.saved, 0.0)


def screen(direction: Direction, effect: Effect, generator: np.random.Generator) -> tuple[Evidence, ...]:
    """One for each joint of the direction."""
    if effect.name == "cross_coupling":
        return tuple(
            _one_joint(direction, effect, joint, generator) for joint in range(len(direction.rotations))
        )
    return _all_joints(direction, effect, direction.signals, generator)


def _one_joint(direction: Direction, effect: Effect, joint: int, generator: np.random.Generator) -> Evidence:
    signals = tuple(
        replace(
            take,
            own=take.own[:, [joint]],
            others={k: v for k, v in take.others.items() if k not in direction.known[joint]},
        )
        for take in direction.signals
    )
    return _all_joints(direction, effect, signals, generator, joints=(joint,))[0]


def _all_joints(
    direction: Direction,
    effect: Effect,
    signals: Sequence[Signals],
    generator: np.random.Generator,
    joints: Sequence[int] | None = None,
) -> tuple[Evidence, ...]:
    joints = range(len(direction.rotations)) if joints is None else joints
    settings = effect.settle(signals)
    grid = effect.grid(signals, settings)
    shapes, lanes, numbers = grid.shape
    tiled = tuple(replace(take, own=np.tile(take.own, (1, shapes))) for take in signals)
    flat = grid.reshape(shapes * lanes, numbers)

    def by_shape(columns: np.ndarray) -> np.ndarray:
        return columns.reshape(len(columns), shapes, lanes, -1)

    true = [by_shape(effect.columns(take, settings, flat)) for take in tiled]
    decoy = [by_shape(part) for part in decoy_columns(effect, tiled, settings, flat, generator)]
    prior = effect.prior_sd(settings)
    found = []
    for lane, joint in enumerate(joints):
        products = direction.products[joint]
        right = held_out(products, direction.rows(joint, [part[:, :, lane] for part in true]), prior)
        wrong = held_out(products, direction.rows(joint, [part[:, :, lane] for part in decoy]), prior)
        found.append(Evidence(right, wrong, grid[right.shape, lane], settings))
    return tuple(found)
