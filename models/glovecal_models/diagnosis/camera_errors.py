"""The camera's errors, told apart from the glove's.

Columns of what a camera gets wrong (``camera_columns``) are part of the base of every joint that it
measured: an effect of the glove has to save more than what they leave. Whether they explain anything is told
first, beside a control whose deviations and visibility are those of half a take later.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.limits import DiagnosisLimits
from glovecal_models.diagnosis.problem import DiagnosisProblem
from glovecal_models.diagnosis.resampled import ResampledTake
from glovecal_models.effects.base.assessment import (
    Assessment,
    JointErrors,
    block_starts,
    over_joints,
    squared_in_blocks,
)
from glovecal_models.takes.camera_estimates import CoveredRange, covered_ranges
from glovecal_models.takes.take import Take

CAMERA = "camera"
"""Name of the finding: not an effect of the catalogue, as nothing of a glove is the cause."""


@dataclass(frozen=True)
class CameraErrors:
    """What the camera's columns explain, and how much of the error its deviations account for."""

    assessment: Assessment
    """Of the columns, beside their control; on the joints of ``stated_deg``."""
    stated_deg: dict[str, float]
    """RMS of the stated deviations of each joint, degrees."""
    ranges: tuple[CoveredRange, ...] = ()
    """Which angles it accepted."""

    @property
    def joints(self) -> tuple[str, ...]:
        """Where an error goes along with the stated deviation or visibility, significantly."""
        return tuple(self.assessment.joints[i] for i in self.assessment.significant_joints)

    @property
    def sentence(self) -> str:
        """Empty where nothing goes along with them."""
        if not self.joints:
            return ""
        rmse = self.assessment.rmse_deg
        return (
            f"An error on {', '.join(self.joints)} goes along with the camera's stated deviation or"
            " visibility: it is the camera's, not the glove's; without it the smoothed error falls from"
            f" {rmse.before:.2f} to {rmse.after:.2f} degrees (control: {rmse.control:.2f})."
        )


def camera_errors(problem: DiagnosisProblem, takes: Sequence[Take]) -> CameraErrors | None:
    """None where no reference states deviations; ``takes`` are those of ``problem``."""
    if problem.is_sparse or not problem.has_camera:
        return None
    without, with_it, control = (problem.design(camera=kind) for kind in ("none", "varying", "control"))
    stated = {name: _rms(problem.even, column) for column, name in enumerate(without.rotations)}
    chosen = [joint for joint, name in enumerate(without.rotations) if np.isfinite(stated[name])]
    errors = tuple(_joint_errors(without, with_it, control, joint) for joint in chosen)
    names = tuple(without.rotations[joint] for joint in chosen)
    nothing = tuple(np.empty(0) for _ in names)
    # It is blamed as soon as may be, few takes or not: every camera errs.
    found = Assessment(CAMERA, names, errors, nothing, nothing, limits=problem.limits).as_of_many_takes
    return CameraErrors(found, {name: stated[name] for name in names}, covered_ranges(takes, names))


def within_camera(
    found: Sequence[Assessment], camera: CameraErrors, problem: DiagnosisProblem, design: ForwardDesign
) -> list[Assessment]:
    """The same, held against what the camera may get wrong at any deviation; ``design``: that of ``problem``.

    A lean that is the same at every deviation looks like an effect: no column of a recording tells it apart.
    So an effect is named on joints on which it saves more than a lean of ``camera_lean_share`` stated
    deviations would, and only where it leaves significantly less error than all that goes along with the
    camera.
    """
    whole, limits = problem.design(camera="whole"), problem.limits
    rival = {
        name: _blocks(whole, design, joint)
        for joint, name in enumerate(design.rotations)
        if name in camera.stated_deg
    }
    return [replace(item, within_camera=_within(item, camera, rival, limits)) for item in found]


def _within(
    item: Assessment,
    camera: CameraErrors,
    rival: Mapping[str, np.ndarray],
    limits: DiagnosisLimits,
) -> tuple[int, ...]:
    small, large = [], []
    for joint in item.significant_joints:
        name, errors = item.joints[joint], item.errors[joint]
        if name in rival:
            saved = float(errors.base.sum() - errors.added.sum()) / max(errors.rows, 1)
            is_small = saved < (limits.camera_lean_share * camera.stated_deg[name]) ** 2
            (small if is_small else large).append(joint)
    large = [joint for joint in large if len(rival[item.joints[joint]]) == len(item.errors[joint].added)]
    if not large:
        return tuple(small)
    better = [
        (rival[item.joints[j]] - item.errors[j].added) / (item.errors[j].base.sum() or 1.0) for j in large
    ]
    takes = [item.errors[j].take for j in large]
    blocks = over_joints(better, takes, by_take=item.p_value is not None)
    if len(blocks) < 2:
        return tuple(small)
    error = float(blocks.std(ddof=1)) / np.sqrt(len(blocks))
    return tuple(small) if blocks.mean() > limits.camera_beaten_se * error else tuple(sorted(small + large))


def _blocks(whole: ForwardDesign, design: ForwardDesign, joint: int) -> np.ndarray:
    """(B,) squared errors of one joint with all that goes along with the camera, weighted as ``design``
    is."""
    units = design.products[joint].units
    parts = [rows.rooted(part) for rows, part in zip(units, whole.products[joint].residual, strict=True)]
    return squared_in_blocks(parts, block_starts([len(part) for part in parts]))


def _joint_errors(
    without: ForwardDesign, with_it: ForwardDesign, control: ForwardDesign, joint: int
) -> JointErrors:
    """All three weighted as the design with the columns is, so that they can be compared."""
    products = [design.products[joint] for design in (without, with_it, control)]
    units = with_it.products[joint].units
    residuals = [
        [rows.rooted(part) for rows, part in zip(units, item.residual, strict=True)] for item in products
    ]
    lengths = [len(part) for part in residuals[0]]
    starts = block_starts(lengths)
    take = np.array(with_it.unit_take)[np.searchsorted(np.cumsum(lengths), starts, side="right")]
    squares = [squared_in_blocks(parts, starts) for parts in residuals]
    return JointErrors(squares[0], squares[1], squares[2], sum(lengths), take)


def _rms(takes: Sequence[ResampledTake], joint: int) -> float:
    known = np.concatenate([take.reference_sd[:, joint] for take in takes if take.reference_sd is not None])
    known = known[np.isfinite(known)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else float("nan")
