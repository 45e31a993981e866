"""What will be fitted: samples gathered, representatives chosen, folds laid out.

Training without dead sensors: rotations that have others are read from those.

Which sensors a rotation is read from where nobody said it: those that explain takes left out.

Of hardware that nobody knows every sensor may tell every rotation. A Gaussian process over all of them takes
minutes and learns the noise of those that tell nothing, so the inputs are chosen first: sensor by sensor, by
the error of a quadratic map on left-out takes, for as long as one more is worth it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from glovecal_models.calibration.fit_task import FitTask
from glovecal_models.calibration.folds import folds_over_takes, usable_folds, wearing_groups
from glovecal_models.calibration.methods import LINEAR_METHODS, METHODS, Method
from glovecal_models.calibration.samples import (
    Samples,
    gather_samples,
    linear_correspondence,
    linear_samples,
    representative_index,
    require_layout,
)
from glovecal_models.calibration.template import (
    missing_shapes,
    palm_gain,
    palm_samples,
    plane_for,
    template_correspondence,
    two_shapes,
    with_sensors_of,
)
from glovecal_models.calibration.training_settings import TrainingSettings, left_out_settings
from glovecal_models.errors import NotTrainable
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.names import did_you_mean
from glovecal_models.regression.regressor import RuleRegressor
from glovecal_models.regression.training_samples import check_samples
from glovecal_models.takes.camera_estimates import CoveredRange, covered_ranges
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import DeadSensor, dead_sensors


@dataclass(frozen=True)
class UsableSensors:
    """What is left of a layout. The glove still sends all its sensors: only what is read of them changes."""

    layout: Layout
    """The same sensors; rotations are read from those that live."""
    dead: tuple[DeadSensor, ...]
    """Of the sensors that some rotation was read from."""
    unreadable: tuple[str, ...]
    """Rotations whose own sensor, or every sensor, is dead; they keep their correspondence."""


def usable_sensors(layout: Layout, takes: Sequence[Take]) -> UsableSensors:
    """Raises LayoutMismatch unless every take has every sensor of the layout."""
    for take in takes:
        require_layout(take, layout)
    found = dead_sensors(takes, layout.sensors) if takes else ()
    dead = {item.sensor for item in found}
    reduced = [_reduced(item, dead) for item in layout.correspondences]
    read = {name for item in layout.correspondences for name in item.sensors}
    kept = (now or before for now, before in zip(reduced, layout.correspondences, strict=True))
    return UsableSensors(
        replace(layout, correspondences=tuple(kept)) if dead & read else layout,
        tuple(item for item in found if item.sensor in read),
        tuple(name for name, now in zip(layout.rotations, reduced, strict=True) if now is None),
    )


def _reduced(item: Correspondence, dead: set[str]) -> Correspondence | None:
    living = tuple(name for name in item.sensors if name not in dead)
    if living == item.sensors:
        return item
    if item.simulated is not None or not living or item.rotation in dead:
        return None
    kind = item.kind if item.kind == "MSMR" or len(living) > 1 else "1S1R"
    return replace(item, sensors=living, kind=kind)


FEWEST_TO_CHOOSE = 5
"""Sensors; a process over fewer is fast enough to be given all."""
MOST_TRIED = 16
"""Sensors beside one another: those that explain most by themselves."""
WORTH_ONE_MORE = 0.02
"""Share of the left-out error that one more sensor has to take away."""
MOST_UNEXPLAINED = 0.2
"""Share of the variance that the chosen sensors may leave: where takes differ by more than noise, as with a
clock that is off, the choice would be of the fault."""
FOLDS = 3
FEWEST_FOR_A_CHOICE = 300
"""With fewer the map of a sensor that tells nothing can win."""
MOST_ROWS = 6000
RIDGE = 1e-6
"""Of a feature's variance."""


def with_chosen_inputs(layout: Layout, unassigned: Collection[str], takes: Sequence[Take]) -> Layout:
    """The layout in which rotations that are ``unassigned`` are read from those of their sensors that explain
    them. Deterministic: the same takes give the same sensors."""
    chosen = tuple(
        _chosen(item, takes)
        if item.rotation in unassigned and item.kind == "MS1R" and len(item.sensors) >= FEWEST_TO_CHOOSE
        else item
        for item in layout.correspondences
    )
    return layout if chosen == layout.correspondences else replace(layout, correspondences=chosen)


def _chosen(item: Correspondence, takes: Sequence[Take]) -> Correspondence:
    samples = gather_samples(takes, item)
    if len(samples) < FEWEST_FOR_A_CHOICE or np.ptp(samples.target) == 0:
        return item
    error = _LeftOutError.of(samples)
    alone = {sensor: error.of_sensors([sensor]) for sensor in range(len(item.sensors))}
    tried = sorted(alone, key=lambda sensor: (alone[sensor], sensor))[:MOST_TRIED]
    kept, left = [tried[0]], alone[tried[0]]
    while len(kept) < len(tried):
        more = {sensor: error.of_sensors([*kept, sensor]) for sensor in tried if sensor not in kept}
        best = min(more, key=lambda sensor: (more[sensor], sensor))
        if more[best] > (1.0 - WORTH_ONE_MORE) ** 2 * left:
            break
        kept, left = [*kept, best], more[best]
    if left > MOST_UNEXPLAINED * error.variance:
        return item
    names = tuple(name for at, name in enumerate(item.sensors) if at in kept)
    return replace(item, sensors=names, kind="1S1R" if len(names) == 1 else "MS1R")


@dataclass(frozen=True)
class _LeftOutError:
    """Mean square error of quadratic maps on the samples that each fold leaves out."""

    inputs: np.ndarray
    """(N, S), standardised."""
    target: np.ndarray
    """(N,)."""
    folds: tuple[np.ndarray, ...]
    """(N,) each, true where a sample is left out."""

    @classmethod
    def of(cls, samples: Samples) -> _LeftOutError:
        rows = samples.select(np.arange(0, len(samples), -(-len(samples) // MOST_ROWS)))
        spread = rows.inputs.std(axis=0)
        inputs = (rows.inputs - rows.inputs.mean(axis=0)) / np.where(spread > 0, spread, 1.0)
        folds = folds_over_takes(rows.take, FOLDS)
        return cls(inputs, rows.target - rows.target.mean(), tuple(fold.held_out for fold in folds))

    @property
    def variance(self) -> float:
        return float(np.var(self.target))

    def of_sensors(self, sensors: Sequence[int]) -> float:
        x = self.inputs[:, sensors]
        first, second = np.triu_indices(x.shape[1])
        features = np.column_stack([np.ones(len(x)), x, x[:, first] * x[:, second]])
        gram, crossed = features.T @ features, features.T @ self.target
        total = 0.0
        for left_out in self.folds:
            own, angles = features[left_out], self.target[left_out]
            kept = gram - own.T @ own
            kept += RIDGE * len(x) * np.eye(len(kept))
            error = angles - own @ np.linalg.solve(kept, crossed - own.T @ angles)
            total += float(error @ error)
        return total / len(x)


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
    Sensors that are dead or clipped are not read, and a rotation that has no other is left out. A process for
    a rotation that is read from every sensor is given those that explain it (``with_chosen_inputs``).
    """
    settings = settings or TrainingSettings()
    if settings.method not in METHODS:
        raise NotTrainable(f"unknown method {settings.method!r}; {did_you_mean(settings.method, METHODS)}")
    usable = usable_sensors(layout, takes)
    unassigned = [
        item.rotation for item in layout.correspondences if set(item.sensors) == set(layout.sensors)
    ]
    if settings.keep_dead:
        usable = UsableSensors(layout, (), ())
    layout = usable.layout
    if settings.method not in LINEAR_METHODS:
        layout = with_chosen_inputs(layout, unassigned, takes)
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
        own, without = _tasks(correspondence, samples, wearings, settings, palm)
        tasks += [*own, *without]
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
    correspondence: Correspondence,
    samples: Samples,
    wearings: Sequence[str],
    settings: TrainingSettings,
    palm: Samples | None,
) -> tuple[list[FitTask], list[FitTask]]:
    """The fits with all samples and of each fold, and those that have not seen some wearings: none without an
    error estimate."""

    def kept_by(kept: np.ndarray) -> Samples:
        return samples_by(settings.method, samples.select(kept))

    def check_rest(kept: np.ndarray) -> None:
        rest = kept_by(kept)
        check_samples(rest.inputs, rest.target, correspondence.inputs)

    tasks = [task_for(correspondence, samples, None, settings, palm=palm)]
    folds = [fold.held_out for fold in folds_over_takes(samples.take, settings.folds)]
    for number, mask in usable_folds(folds, check_rest):
        held_out, kept = samples.select(mask), kept_by(~mask)
        tasks.append(task_for(correspondence, kept, number, settings, held_out=held_out, palm=palm))
    without, owner = [], np.array(wearings, dtype=object)[samples.take]
    groups = wearing_groups(wearings) if settings.folds else []
    for number, mask in usable_folds([np.isin(owner, group) for group in groups], check_rest):
        if mask.any():
            fold, chosen, kept = settings.folds + number, left_out_settings(settings), kept_by(~mask)
            without.append(task_for(correspondence, kept, fold, chosen, palm=palm, without=groups[number]))
    if settings.people:
        known = [
            [replace(task, wearings=tuple(wearings), key="") for task in part] for part in (tasks, without)
        ]
        return known[0], known[1]
    return tasks, without


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
