"""What all candidates are judged on: resampled takes, joints, base and the effects known already."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from glovecal_models.diagnosis.camera_columns import CameraPart
from glovecal_models.diagnosis.candidates import FormInputs
from glovecal_models.diagnosis.forward_design import EVERY, ForwardBasis, ForwardDesign, forward
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.resampled import (
    RATE_HZ,
    SMOOTHING,
    ResampledTake,
    bridge_s,
    resampled,
    shifted,
    smoothed,
)
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.effect import CorrectionEffect, Effect
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
    bases: dict[tuple[int, int, CameraPart], ForwardBasis] = field(default_factory=dict, compare=False)
    """What the designs of the same takes share, by smoothing, rows that are fitted, and camera."""

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
        even = tuple(_with_joints(take, fitted) for take in even)
        joints = tuple(name for name, is_fitted in zip(joints, fitted, strict=True) if is_fitted)
        return cls(even, layout, joints, linear, tuple(known), limits)

    @property
    def is_sparse(self) -> bool:
        """Whether the frames are single poses."""
        return all(take.is_sparse for take in self.even)

    @cached_property
    def still(self) -> frozenset[str]:
        """Joints that hardly move within any take: with their angle nothing goes along but noise."""
        if self.is_sparse:
            return frozenset()
        known = [np.isfinite(take.reference) for take in self.even]
        moved = [
            np.where(mask, take.reference - _mean(take.reference, mask), 0.0)
            for take, mask in zip(self.even, known, strict=True)
        ]
        spread = np.sqrt(_mean(np.concatenate(moved) ** 2, np.concatenate(known)))
        return frozenset(np.array(self.joints)[spread < self.limits.least_moved_deg].tolist())

    @property
    def is_still(self) -> bool:
        """Whether no joint moves."""
        return len(self.still) == len(self.joints)

    @property
    def has_camera(self) -> bool:
        """Whether a reference states deviations."""
        return any(take.reference_sd is not None for take in self.even)

    def design(
        self, smoothing: int = SMOOTHING, every: int = EVERY, camera: CameraPart = "varying"
    ) -> ForwardDesign:
        """Readings from angles, on signals smoothed over so many rows; one row in ``every`` is fitted."""
        chosen = smoothing, every, camera
        if chosen not in self.bases:
            self.bases[chosen] = ForwardBasis.of(
                *([smoothed(take, smoothing) for take in self.even], self.layout, self.joints),
                linear=self.linear,
                same_angle_share=self.limits.same_angle_share,
                same_angle_deg=self.limits.same_angle_deg,
                every=every,
                camera=camera,
            )
        return forward(self.bases[chosen], self.joints, known=self.known, limits=self.limits)

    def saved_by_known(self, design: ForwardDesign) -> dict[str, float]:
        """Squared degrees per row that the known effects save on each joint, held out; empty without any.

        ``design`` is the one with them.
        """
        if not self.known:
            return {}
        without = replace(self, known=()).design().mean_square()
        return {name: max(without[name] - left, 0.0) for name, left in design.mean_square().items()}

    def beside(self, *effects: KnownEffect) -> DiagnosisProblem:
        """The same with further effects in the base."""
        return replace(self, known=(*self.known, *effects))

    def with_first(
        self, first: Assessment | None, effects: Mapping[str, Effect], design: ForwardDesign
    ) -> DiagnosisProblem:
        """The same with the first of a ranking in the base, or repaired: what is left after it.

        ``first``: None when nothing is ranked; ``design`` is the one without it.
        """
        if first is None:
            return self
        comparison = effects[first.effect].comparison
        delay = None if comparison is None else comparison.reference_delay_s(first)
        if delay is not None:
            delay = np.broadcast_to(delay, (len(self.even),))
            moved = [shifted(take, float(by)) for take, by in zip(self.even, delay, strict=True)]
            return replace(self, even=tuple(moved), bases={})
        where = tuple(first.joints[i] for i in first.significant_joints)
        shapes = tuple(first.shapes[i] for i in first.significant_joints)
        stored = {} if first.steps is None else first.steps.to_settings()
        known = KnownEffect(effects[first.effect], where, shapes, stored=stored)
        return self.beside(_with_learned_terms(known, design))


def _mean(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """(R,) of the rows (N, R) that are known; 0 without any."""
    return np.where(known, values, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)


def _with_joints(take: ResampledTake, kept: np.ndarray) -> ResampledTake:
    deviations = None if take.reference_sd is None else take.reference_sd[:, kept]
    return replace(take, reference=take.reference[:, kept], reference_sd=deviations)


def _with_learned_terms(known: KnownEffect, design: ForwardDesign) -> KnownEffect:
    """The same in the form that the takes of ``design``, whose base does not have it, ask for."""
    terms, together, effect = [], known.side_by_side(design.signals, design.rotations), known.effect
    assert isinstance(effect, CorrectionEffect), "only corrections are known with shapes"
    for joint, shape in zip(known.joints, known.shapes, strict=True):
        lane = design.rotations.index(joint)
        takes = design.of_joint(lane)
        settings = effect.further.constants(effect, takes)
        plain = together.get(joint)
        inputs = FormInputs.of(design, lane, effect, takes, settings, shape[None, :], plain=plain)
        terms.append(inputs.terms(design, lane, range(len(inputs.plain))))
    return replace(known, terms=tuple(terms))


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
