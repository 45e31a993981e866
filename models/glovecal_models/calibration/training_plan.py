"""What will be fitted: samples gathered, representatives chosen, folds laid out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from glovecal_models.calibration.fit_task import FitTask
from glovecal_models.calibration.folds import folds_over_takes, wearing_groups
from glovecal_models.calibration.prior_mean import plane_for, with_sensors_of
from glovecal_models.calibration.samples import (
    Samples,
    gather_samples,
    linear_correspondence,
    linear_samples,
    representative_index,
)
from glovecal_models.calibration.template import (
    missing_shapes,
    palm_gain,
    palm_samples,
    template_correspondence,
    two_shapes,
)
from glovecal_models.calibration.training_settings import (
    LINEAR_METHODS,
    METHODS,
    Method,
    TrainingSettings,
    left_out_settings,
)
from glovecal_models.calibration.usable_sensors import UsableSensors, usable_sensors
from glovecal_models.errors import NotTrainable
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.names import did_you_mean
from glovecal_models.regression.regressor import RuleRegressor
from glovecal_models.regression.training_samples import check_samples
from glovecal_models.takes.camera_reference.covered_range import CoveredRange, covered_ranges
from glovecal_models.takes.take import Take


@dataclass(frozen=True)
class TrainingPlan:
    """What will be fitted, and which rotations cannot be."""

    layout: Layout
    subject: str
    settings: TrainingSettings
    tasks: tuple[FitTask, ...]
    correspondences: Mapping[str, Correspondence]
    """Of each trained rotation; for a linear model its measuring sensor alone."""
    rules: Mapping[str, RuleRegressor]
    ranges: Mapping[str, tuple[np.ndarray, np.ndarray]]
    usable: UsableSensors
    unreadable: tuple[str, ...]
    """Measured rotations that no working sensor reads."""
    unmeasured: tuple[str, ...]
    only_angle_deg: Mapping[str, float]
    """Rotations that were measured at a single angle."""
    unshown: tuple[str, ...]
    """Measured rotations of which the method lacks a hand shape."""
    take_count: int
    frame_count: int
    simulated: bool
    wearings: tuple[str, ...] = ()
    """Of each take."""
    samples: Mapping[str, Samples] = field(default_factory=dict)
    """All samples of each trained rotation, where a wearing is left out."""
    camera_ranges: tuple[CoveredRange, ...] = ()
    """Of the trained rotations whose reference states deviations."""


def plan_training(
    takes: Sequence[Take], layout: Layout, subject: str, settings: TrainingSettings | None = None
) -> TrainingPlan:
    """Gather samples, choose representatives, lay out the folds. Raises NotTrainable, LayoutMismatch.

    A rotation that no take measured is left out of the model, unless the layout gives it a rule whose
    rotations are trained; so is one that was held at a single angle, as when a sampling was stopped early.
    Sensors that are dead or clipped are not read, and a rotation that has no other is left out.
    """
    settings = settings or TrainingSettings()
    if settings.method not in METHODS:
        raise NotTrainable(f"unknown method {settings.method!r}; {did_you_mean(settings.method, METHODS)}")
    usable = usable_sensors(layout, takes)
    if settings.keep_dead:
        usable = UsableSensors(layout, (), ())
    layout = usable.layout
    tasks: list[FitTask] = []
    chosen: dict[str, Correspondence] = {}
    ranges: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    unmeasured: list[Correspondence] = []
    at_one_angle: list[tuple[Correspondence, Samples]] = []
    unreadable: list[str] = []
    unshown: list[Correspondence] = []
    wearings = tuple(take.wearing for take in takes)
    gathered: dict[str, Samples] = {}
    for correspondence in layout.correspondences:
        correspondence = correspondence_by(settings.method, correspondence, layout.sensors)
        if settings.prior:
            correspondence = with_sensors_of(
                correspondence, plane_for(correspondence.rotation, settings.prior)
            )
        samples = gather_samples(takes, correspondence)
        if len(samples) == 0:
            unmeasured.append(correspondence)
            continue
        if correspondence.rotation in usable.unreadable:
            unreadable.append(correspondence.rotation)
            continue
        told = samples_by(settings.method, samples)
        if len(told) == 0:
            unshown.append(correspondence)
            continue
        if np.ptp(told.target) == 0:
            at_one_angle.append((correspondence, samples))
            continue
        check_samples(samples.inputs, samples.target, correspondence.inputs)
        chosen[correspondence.rotation] = correspondence
        ranges[correspondence.rotation] = (samples.inputs.min(axis=0), samples.inputs.max(axis=0))
        palm = palm_samples(takes, correspondence) if settings.method == "template" else None
        tasks.extend(_tasks(correspondence, samples, settings, palm))
        without = _without_wearings(correspondence, samples, wearings, settings, palm)
        tasks.extend(without)
        if without:
            gathered[correspondence.rotation] = samples
    for correspondence, samples in at_one_angle if not tasks else ():
        check_samples(samples.inputs, samples.target, correspondence.inputs)
    if not tasks and unreadable:
        raise NotTrainable(
            f"no working sensor measures {', '.join(unreadable)}; dead in these takes: "
            f"{', '.join(map(str, usable.dead))}. Is a wire broken?"
        )
    if not tasks and unshown:
        raise NotTrainable(missing_shapes([item.rotation for item in unshown], takes))
    if not tasks:
        raise NotTrainable(
            f"no reference angle for any rotation of layout {layout.name!r} in {len(takes)} takes; "
            "import takes with r.ROTATION columns"
        )
    rules = _rules([*unmeasured, *unshown], chosen)
    return TrainingPlan(
        layout=layout,
        subject=subject,
        settings=settings,
        tasks=tuple(tasks),
        correspondences=chosen,
        rules=rules,
        ranges=ranges,
        usable=usable,
        unreadable=tuple(unreadable),
        unmeasured=tuple(item.rotation for item in unmeasured),
        unshown=tuple(item.rotation for item in unshown if item.rotation not in rules),
        only_angle_deg={item.rotation: float(samples.target[0]) for item, samples in at_one_angle},
        take_count=len(takes),
        frame_count=sum(len(take.time_s) for take in takes),
        simulated=any(take.simulated for take in takes),
        wearings=wearings,
        samples=gathered,
        camera_ranges=(
            covered_ranges(takes, tuple(chosen))
            if any(take.reference_sd is not None for take in takes)
            else ()
        ),
    )


def correspondence_by(method: Method, item: Correspondence, sensors: Sequence[str]) -> Correspondence:
    """What a model of ``method`` reads a rotation from; ``sensors``: those of the glove that work."""
    if method == "template":
        return template_correspondence(item, sensors)
    return linear_correspondence(item) if method in LINEAR_METHODS else item


def samples_by(method: Method, samples: Samples) -> Samples:
    """Those that a model of ``method`` can be trained on."""
    return two_shapes(samples) if method == "two_shapes" else samples


def _tasks(
    correspondence: Correspondence, samples: Samples, settings: TrainingSettings, palm: Samples | None
) -> list[FitTask]:
    tasks = [task_for(correspondence, samples, None, settings, palm=palm)]
    for number, fold in enumerate(folds_over_takes(samples.take, settings.folds)):
        kept = samples_by(settings.method, samples.select(~fold.held_out))
        try:
            check_samples(kept.inputs, kept.target, correspondence.inputs)
        except NotTrainable:
            continue  # what is left of the fold cannot carry a model: it says nothing about the error
        held_out = samples.select(fold.held_out)
        task = task_for(correspondence, kept, number, settings, held_out=held_out, palm=palm)
        tasks.append(task)
    return tasks


def _without_wearings(
    correspondence: Correspondence,
    samples: Samples,
    wearings: Sequence[str],
    settings: TrainingSettings,
    palm: Samples | None,
) -> list[FitTask]:
    """Fits that have not seen some wearings; none without an error estimate."""
    if settings.folds < 1:
        return []
    tasks, owner = [], np.array(wearings, dtype=object)[samples.take]
    for number, group in enumerate(wearing_groups(wearings)):
        is_left_out = np.isin(owner, group)
        kept = samples_by(settings.method, samples.select(~is_left_out))
        try:
            check_samples(kept.inputs, kept.target, correspondence.inputs)
        except NotTrainable:
            continue  # what is left cannot carry a model: it says nothing about the error
        if is_left_out.any():
            fold, chosen = settings.folds + number, left_out_settings(settings)
            tasks.append(task_for(correspondence, kept, fold, chosen, palm=palm, without=group))
    return tasks


def task_for(
    correspondence: Correspondence,
    samples: Samples,
    fold: int | None,
    settings: TrainingSettings,
    held_out: Samples | None = None,
    palm: Samples | None = None,
    without: tuple[str, ...] = (),
) -> FitTask:
    """``palm``: samples of the palm; those of takes that ``samples`` has are used. ``without``: wearings that
    ``samples`` does not have."""
    known_gain = None
    if palm is not None:
        known_gain = palm_gain(palm.select(np.isin(palm.take, samples.take)))
    samples = linear_samples(samples) if settings.method == "linear" else samples_by(settings.method, samples)
    index = representative_index(samples, settings.samples, seed=settings.seed)
    return FitTask(
        rotation=correspondence.rotation,
        fold=fold,
        inputs=samples.inputs[index],
        target=samples.target[index],
        take=samples.take[index],
        position=index,
        held_out_inputs=held_out.inputs if held_out else np.empty((0, samples.inputs.shape[1])),
        held_out_target=held_out.target if held_out else np.empty(0),
        sensors=correspondence.inputs,
        settings=settings,
        without=without,
        known_gain=known_gain,
        variance=None if samples.variance is None else samples.variance[index],
    )


def _rules(
    unmeasured: Sequence[Correspondence], trained: Mapping[str, Correspondence]
) -> dict[str, RuleRegressor]:
    rules = {}
    for correspondence in unmeasured:
        expression = correspondence.simulated
        if expression and all(name in trained for name in expression.sensors):
            weights = expression.weights(expression.sensors)
            rules[correspondence.rotation] = RuleRegressor(expression.sensors, weights)
    return rules
