"""Training a whole glove: plan, fit, assemble."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from glovecal_models.calibration.fit_task import FitResult, run_task
from glovecal_models.calibration.model import CalibrationModel, RotationModel, restore_regressor
from glovecal_models.calibration.training_plan import TrainingPlan, plan_training
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.calibration.unseen_wearing import LeftOutWearing, UnseenWearing, unseen_wearing
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.progress import Cancel, Report
from glovecal_models.regression.regressor import RuleRegressor
from glovecal_models.takes.take import Take


def train(
    takes: Sequence[Take],
    layout: Layout,
    subject: str,
    settings: TrainingSettings | None = None,
    *,
    take_hashes: Sequence[str] = (),
    parent: str | None = None,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> CalibrationModel:
    """Plan, fit and assemble in this process; a service spreads the same tasks over workers."""
    plan = plan_training(takes, layout, subject, settings)
    results = []
    for done, task in enumerate(plan.tasks):
        if report:
            report(f"fitting {task.rotation}", done / len(plan.tasks))
        results.append(run_task(task, cancelled=cancelled))
    return assemble(plan, results, take_hashes=take_hashes, parent=parent)


def assemble(
    plan: TrainingPlan,
    results: Sequence[FitResult],
    *,
    take_hashes: Sequence[str],
    parent: str | None = None,
) -> CalibrationModel:
    """The model made of the finished fits of ``plan``: the same, to the byte, in whatever order they come."""
    planned = {(task.rotation, task.fold, task.without): place for place, task in enumerate(plan.tasks)}
    results = sorted(results, key=lambda item: planned[item.rotation, item.fold, item.without])
    rotations = []
    squared, count = 0.0, 0
    for correspondence in plan.layout.correspondences:
        name = correspondence.rotation
        if name in plan.rules:
            rotations.append(_rule_model(correspondence, plan.rules[name]))
        elif name in plan.correspondences:
            own = [result for result in results if result.rotation == name]
            rotation, error, held_out = _rotation_model(plan, name, own)
            rotations.append(rotation)
            squared, count = squared + error, count + held_out
    unseen = _unseen_wearing(plan, rotations, results)
    estimate: dict[str, Any] = {"how": _how_held_out(plan), "folds": plan.settings.folds}
    if count:
        estimate["rmse_deg"] = float(np.sqrt(squared / count))
    if unseen.rmse_deg is not None:
        estimate["rmse_unseen_wearing_deg"] = unseen.rmse_deg
    if plan.camera_ranges:
        estimate["camera_ranges"] = [
            {"rotation": item.rotation, "ranges_deg": [list(pair) for pair in item.ranges_deg]}
            for item in plan.camera_ranges
        ]
    return CalibrationModel(
        layout=plan.layout,
        subject=plan.subject,
        method=plan.settings.method,
        rotations=tuple(rotations),
        takes=tuple(take_hashes),
        parent=parent,
        error_estimate=estimate,
        simulated=plan.simulated,
        unseen_wearing=unseen,
    )


def _unseen_wearing(
    plan: TrainingPlan, rotations: Sequence[RotationModel], results: Sequence[FitResult]
) -> UnseenWearing:
    """From the fits that some wearings were left out of."""
    wearings, left_out = np.array(plan.wearings, dtype=object), []
    for result in results:
        for wearing in result.without:
            samples = plan.samples[result.rotation]
            left = samples.select(wearings[samples.take] == wearing)
            if len(left):
                regressor = restore_regressor(result.arrays, result.settings)
                predicted, noise = regressor.predict(left.inputs), float(regressor.noise_variance)
                trained = len(set(plan.wearings) - set(result.without))
                square = float(np.sum((predicted.mean - left.target) ** 2))
                claimed = float(predicted.variance.mean()) + noise
                left_out.append(
                    LeftOutWearing(result.rotation, wearing, trained, square, len(left), claimed, noise)
                )
    return unseen_wearing(plan.wearings, left_out, noise_of(rotations))


def noise_of(rotations: Sequence[RotationModel]) -> dict[str, float]:
    """Claimed measurement noise of the rotations with a regressor of their own, degrees squared."""
    return {
        item.rotation: float(item.regressor.noise_variance)
        for item in rotations
        if not isinstance(item.regressor, RuleRegressor)
    }


def _rule_model(correspondence: Correspondence, rule: RuleRegressor) -> RotationModel:
    return RotationModel(
        correspondence, rule, np.empty(0), np.empty(0), uncertain_above(rule.noise_variance), None, 0
    )


def _rotation_model(
    plan: TrainingPlan, name: str, own: Sequence[FitResult]
) -> tuple[RotationModel, float, int]:
    whole = next(result for result in own if result.fold is None)
    regressor = restore_regressor(whole.arrays, whole.settings)
    squared = sum(result.held_out_squared_error for result in own)
    count = sum(result.held_out_count for result in own)
    task = next(task for task in plan.tasks if task.rotation == name and task.fold is None)
    low, high = plan.ranges[name]
    model = RotationModel(
        correspondence=plan.correspondences[name],
        regressor=regressor,
        input_low=low,
        input_high=high,
        uncertain_above_deg=uncertain_above(regressor.noise_variance),
        held_out_rmse_deg=float(np.sqrt(squared / count)) if count else None,
        samples=len(task.target),
    )
    return model, squared, count


def uncertain_above(noise_variance: float) -> float:
    """The standard deviation (degrees) above which a prediction is "too uncertain to use".

    Twice the measurement noise, at least 2 degrees: beyond it the model says less than one glance at the
    reference would (Wang & Neff 2013, section 9: too large a variance should not be applied).
    """
    return max(2.0, 2.0 * float(np.sqrt(noise_variance)))


def _how_held_out(plan: TrainingPlan) -> str:
    if plan.settings.folds < 1:
        return "not estimated"
    return "whole takes left out" if plan.take_count > 1 else "stretches of the only take left out"
