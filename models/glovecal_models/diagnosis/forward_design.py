"""What a diagnosis is fitted on: each joint's own sensor from the measured angles (forward).

A noisy reference rewards any low pass in this direction; strong smoothing and controls take that away. The
other direction, angle from sensors, is what adding an effect tries.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from glovecal_models.calibration.held_out import BaseProducts
from glovecal_models.diagnosis.forward_basis import ForwardBasis
from glovecal_models.diagnosis.known_effect import KnownColumns, KnownEffect, one_lane
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.signals import Signals


@dataclass(frozen=True)
class ForwardDesign:
    """All joints, sensor from angles."""

    rotations: tuple[str, ...]
    signals: tuple[Signals, ...]
    """One for each take, own (N, R)."""
    known: tuple[frozenset[str], ...]
    """Names among ``others`` that the base of each joint reads already, and joints that tell its angle."""
    unit_take: tuple[int, ...]
    """The take of each unit that is left out: a whole take, or a quarter of a short one."""
    used: tuple[tuple[np.ndarray, ...], ...]
    """For each joint and unit: indices of its take's rows that are fitted."""
    products: tuple[BaseProducts, ...]
    """For each joint."""
    known_deg: tuple[tuple[np.ndarray, ...], ...] = ()
    """For each joint and take (N,): what the known effects without a memory add; no take where none does."""
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS

    kept: dict[str, Any] = field(default_factory=dict, compare=False)
    """What effects worked out together."""

    def once(self, what: str, work: Callable[[], Any]) -> Any:
        """The result of ``work``, kept for whoever asks for the same again."""
        if what not in self.kept:
            self.kept[what] = work()
        return self.kept[what]

    def constants(self, effect: Effect) -> Settings:
        """Those of ``effect`` on all joints; not to be changed."""
        return self.once(f"constants of {effect.name}", lambda: effect.fit_constants(self.signals))

    def rows(self, joint: int, columns: Sequence[np.ndarray]) -> list[np.ndarray]:
        """``columns``: for each take (N, ...); the fitted rows of those."""
        return [columns[take][index] for take, index in self.units(joint)]

    def of_joint(self, joint: int) -> tuple[Signals, ...]:
        """The signals of one joint alone, without those that its base reads already."""
        return tuple(one_lane(_without(take, self.known[joint]), joint) for take in self.signals)

    def mean_square(self) -> dict[str, float]:
        """Held-out squared error of each joint, degrees squared per row."""
        return {
            name: float(item.error.sum() / max(item.count.sum(), 1))
            for name, item in zip(self.rotations, self.products, strict=True)
        }

    def units(self, joint: int) -> Iterator[tuple[int, np.ndarray]]:
        """Take and row indices of each unit."""
        return zip(self.unit_take, self.used[joint], strict=True)


def forward(
    basis: ForwardBasis,
    rotations: Sequence[str],
    *,
    known: Sequence[KnownEffect] = (),
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS,
) -> ForwardDesign:
    """Own sensor, scaled to degrees, from the measured angles; ``known`` effects belong to the base.

    Where deviations of the reference are stated, rows count by them.
    """
    products, known_deg = [], []
    together = [each.side_by_side(basis.signals, rotations) for each in known]
    for column, (rotation, joint) in enumerate(zip(rotations, basis.joints, strict=True)):
        without = [_without(take, joint.beside) for take in basis.signals] if known else []
        found = [
            each.columns(without, column, rotation, columns)
            for each, columns in zip(known, together, strict=True)
        ]
        there = [(each, item) for each, item in zip(known, found, strict=True) if item is not None]
        products.append(joint.products(basis.unit_take, [item for _, item in there]))
        known_deg.append(_without_memory(there, products[-1]))
    return ForwardDesign(
        tuple(rotations),
        basis.signals,
        tuple(joint.read for joint in basis.joints),
        basis.unit_take,
        tuple(joint.used for joint in basis.joints),
        tuple(products),
        tuple(known_deg),
        limits,
    )


def _without_memory(
    known: Sequence[tuple[KnownEffect, KnownColumns]], products: BaseProducts
) -> tuple[np.ndarray, ...]:
    """For each take (N,) degrees: what those of ``known`` that have no memory add to one joint."""
    parts: list[list[np.ndarray]] = []
    first = products.own
    for each, columns in known:
        stop = first + len(columns.prior_sd)
        if not each.effect.has_memory:
            parts.append([part @ products.whole[first:stop] for part in columns.parts])
        first = stop
    return tuple(np.sum(of_take, axis=0) for of_take in zip(*parts, strict=True))


def _without(take: Signals, known: frozenset[str]) -> Signals:
    return replace(take, others={name: v for name, v in take.others.items() if name not in known})
