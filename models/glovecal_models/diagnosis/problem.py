"""What all candidates are judged on: resampled takes, joints, base and the effects known already."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.diagnosis.forward_design import EVERY, ForwardDesign, forward
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.naming import Naming
from glovecal_models.diagnosis.resampled import (
    RATE_HZ,
    SMOOTHING,
    ResampledTake,
    bridge_s,
    resampled,
    shifted,
    smoothed,
)
from glovecal_models.effects.base.effect import Effect
from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take


@dataclass(frozen=True)
class DiagnosisProblem:
    """Everything a forward design is made of but the smoothing."""

    even: tuple[ResampledTake, ...]
    layout: Layout
    joints: tuple[str, ...]
    linear: bool
    known: tuple[KnownEffect, ...]
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS

    @classmethod
    def of(
        cls,
        takes: Sequence[Take],
        layout: Layout,
        linear: bool,
        known: Sequence[KnownEffect],
        limits: DiagnosisLimits = DIAGNOSIS_LIMITS,
    ) -> DiagnosisProblem:
        """Raises BadInput when no take measured a joint of the layout."""
        joints = measured_joints(takes, layout)
        if not joints:
            raise BadInput("no take measured a rotation of this layout; a diagnosis needs r.ROTATION columns")
        bridge = bridge_s(takes)
        even = [resampled(take, layout.sensors, joints, bridge) for take in takes]
        fitted = _fitted_columns(even)
        if not fitted.any():
            raise BadInput(
                f"no reference lasts for {SMOOTHING / RATE_HZ:.2g} s without a gap; a diagnosis needs"
                " references that are measured several times a second"
            )
        even = tuple(replace(take, reference=take.reference[:, fitted]) for take in even)
        joints = tuple(name for name, is_fitted in zip(joints, fitted, strict=True) if is_fitted)
        return cls(even, layout, joints, linear, tuple(known), limits)

    @property
    def is_sparse(self) -> bool:
        """Whether the frames are single poses."""
        return all(take.is_sparse for take in self.even)

    def design(self, smoothing: int = SMOOTHING) -> ForwardDesign:
        """Readings from angles, on signals smoothed over so many rows."""
        even = [smoothed(take, smoothing) for take in self.even]
        return forward(
            even, self.layout, self.joints, linear=self.linear, known=self.known, limits=self.limits
        )

    def beside(self, *effects: KnownEffect) -> DiagnosisProblem:
        """The same with further effects in the base."""
        return replace(self, known=(*self.known, *effects))

    def with_first(self, naming: Naming, effects: Mapping[str, Effect]) -> DiagnosisProblem:
        """The same with the first of the ranking in the base, or repaired: what is left after it."""
        if not naming.ranked:
            return self
        first = naming.ranked[0]
        delay = effects[first.effect].reference_delay_s(first)
        if delay is not None:
            delay = np.broadcast_to(delay, (len(self.even),))
            moved = [shifted(take, float(by)) for take, by in zip(self.even, delay, strict=True)]
            return replace(self, even=tuple(moved))
        where = tuple(first.joints[i] for i in first.significant_joints)
        shapes = tuple(first.shapes[i] for i in first.significant_joints)
        return self.beside(KnownEffect(effects[first.effect], where, shapes))


def _fitted_columns(even: Sequence[ResampledTake]) -> np.ndarray:
    """(R,) whether enough is left of each joint's reference once it is smoothed."""
    known = [np.isfinite(smoothed(take, SMOOTHING).reference[::EVERY]).sum(axis=0) for take in even]
    return np.sum(known, axis=0) > 1


def measured_joints(takes: Sequence[Take], layout: Layout) -> tuple[str, ...]:
    """Rotations of the layout that some take measured, and that move."""
    return tuple(
        name
        for name in layout.rotations
        if any(
            name in take.rotations and np.isfinite(take.reference[:, take.rotations.index(name)]).sum() > 1
            for take in takes
        )
    )
