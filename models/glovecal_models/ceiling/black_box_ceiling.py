"""Is anything left to gain from what was recorded? A black box on the held-out errors of a model.

The box sees readings now, their history, context, and wearing and time. Two controls say what is no gain:
with the columns of other takes it shows what flexibility alone brings; with a history that knows no direction
it shows what averaging brings. The gain is what the box takes off beyond both, on takes that neither the
model nor the box has seen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from glovecal_models.calibration.effect_fit import optima_of
from glovecal_models.calibration.leave_out import TakeErrors, held_out_take_errors
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training_settings import (
    TrainingSettings,
    declared_effects,
    repaired_takes,
    requested_effects,
    settings_of,
    trained_rotations,
)
from glovecal_models.ceiling.black_box import (
    GROUPS,
    MOST_ROWS,
    ROW_EVERY,
    TakeColumns,
    exchange_order,
    exchanged,
    left_by_box,
    own_averages,
    recorded_columns,
    smoothed_error,
)
from glovecal_models.ceiling.ceiling import CEILING_LIMITS, Ceiling, CeilingLimits, Gain, is_gain, verdict_of
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.catalogue import catalogue
from glovecal_models.progress import Cancel, Report, part, stop_if
from glovecal_models.takes.take import Take
from glovecal_models.worker_processes import side_by_side

WORTH_CONTROLS = 0.005
"""Share of the squared error; a box that gains less needs no controls."""
FOLDS = 4
"""Takes are left out in so many parts: the box learns from the errors of every take."""
MOST_OWN_SENSORS = 4
SINGLE_POSES_S = 0.25
"""Between frames: further apart they are single poses, which have no history."""


def black_box_ceiling(
    model: CalibrationModel,
    takes: Sequence[Take],
    settings: TrainingSettings | None = None,
    *,
    seed: int = 0,
    limits: CeilingLimits = CEILING_LIMITS,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> Ceiling:
    """Of the model's recipe, trained again without each quarter of ``takes``.

    Same seed, same answer. Raises NotTrainable, BadInput, LayoutMismatch, Cancelled.
    """
    wanted, settings = requested_effects(model), settings_of(model, settings)
    prepared = PreparedTakes.of(repaired_takes(_measured(takes, model), wanted), model.layout)
    count = len(prepared.takes)
    if count < limits.fewest_takes:
        return _undecided(f"{count} takes were measured, {limits.fewest_takes} are needed", count, limits)
    if any(_is_of_single_poses(take) for take in prepared.takes):
        return _undecided("the takes are single poses, without a history", count, limits)
    names = trained_rotations(model)
    errors = held_out_take_errors(
        prepared,
        names,
        wanted,
        settings,
        folds=FOLDS,
        optima=optima_of(model),
        cancelled=cancelled,
        report=part(report, 0.0, 0.25, "held-out error"),
    )
    found = _of_errors(prepared, names, errors, seed, limits, cancelled, report)
    found = replace(found, unrecorded=_unrecorded(prepared.takes, declared_effects(model)))
    if report:
        report("done", 1.0)
    return found


def _of_errors(
    prepared: PreparedTakes,
    names: Sequence[str],
    errors: TakeErrors,
    seed: int,
    limits: CeilingLimits,
    cancelled: Cancel | None,
    report: Report | None,
) -> Ceiling:
    wearings = [take.wearing for take in prepared.takes]
    order = exchange_order(wearings, np.random.default_rng(seed))
    boxes: dict[str, _Boxes] = {}
    each = [
        (name, TakeErrors(*([take[:, [at]] for take in takes] for takes in errors)))
        for at, name in enumerate(names)
    ]
    found = side_by_side(partial(_boxes_of, prepared, order, seed), each, cancelled)
    for number, name in enumerate(names):
        if report:
            report(f"black box on {name}", 0.25 + 0.75 * number / len(names))
        of_rotation = next(found)
        if of_rotation is not None:
            boxes[name] = of_rotation
    if not boxes:
        why = f"no rotation was measured in {limits.fewest_takes} takes"
        return _undecided(why, len(prepared.takes), limits)
    return _summed_up(boxes, prepared, seed, limits)


def _boxes_of(
    prepared: PreparedTakes,
    order: Sequence[int],
    seed: int,
    rotation: tuple[str, TakeErrors],
    cancelled: Cancel | None,
) -> _Boxes | None:
    """Of a rotation by its name and its errors, each (N, 1); None where a take did not measure it."""
    stop_if(cancelled, "the ceiling")
    name, errors = rotation
    own = _own_sensors(prepared, name)
    scale = np.concatenate(prepared.readings).std(axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    columns = recorded_columns(prepared.takes, prepared.readings, own, scale)
    rows = RotationRows.of(columns, prepared, [error[:, 0] for error in errors.live], order, own)
    if rows is None:
        return None
    offline = np.concatenate([error[:, 0] for error in errors.offline])
    return replace(_boxes(rows, seed), offline_square=float(np.nanmean(offline**2)))


@dataclass(frozen=True)
class _Boxes:
    """What is saved of one rotation's squared error, degrees squared."""

    saved: np.ndarray
    """For each take, scaled so that its mean is what is saved of the mean square."""
    mean_square: float
    groups: dict[str, float]
    """Rise of the mean square when a group is exchanged between takes."""
    by_take_share: float
    """Of the mean square, that changes from take to take."""
    offline_square: float = np.nan
    """Mean square of what is left with both directions of time, without a box."""


def _boxes(rows: RotationRows, seed: int) -> _Boxes:
    count, total = int(rows.take.max()) + 1, len(rows.target)
    alone = np.bincount(rows.take, rows.target**2, count)
    places, at = {}, 0
    for name in GROUPS:
        width = rows.groups[name].shape[1]
        places[name] = (slice(at, at + width), rows.others[name])
        at += width
    powers, products = products_of(rows)
    box = left_by_box(joined(rows.groups), rows.target, rows.take, seed, places, products)
    saved = alone - box.square
    if saved.sum() > WORTH_CONTROLS * rows.mean_square * total:
        without = {name: values for name, values in rows.groups.items() if name != "history"}
        directionless = joined(rows.groups | {"history": rows.symmetric})
        flexible, now, averaged = (
            left_by_box(columns, rows.target, rows.take, seed, products=of).square
            for columns, of in (
                (joined(rows.others), products),
                (joined(without), powers),
                (directionless, powers),
            )
        )
        for less, more in ((alone, flexible), (now, averaged)):
            if less.sum() > more.sum():
                saved = saved - (less - more)
    rise = {name: float((values.sum() - box.square.sum()) / total) for name, values in box.without.items()}
    share = _by_take(rows) / rows.mean_square
    return _Boxes(saved * count / total, rows.mean_square, rise, share)


def _by_take(rows: RotationRows) -> float:
    """Mean square that a line in the readings of its own explains of each take, beyond one line for all.

    A column that stands still in a take can explain no more than this, and there are as many values of it as
    takes: a box that finds nothing there has not shown that nothing is there.
    """
    x = np.column_stack([np.ones(len(rows.target)), rows.groups["readings"][:, rows.own]])
    left = rows.target - x @ np.linalg.lstsq(x, rows.target, rcond=None)[0]
    explained = 0.0
    for number in range(int(rows.take.max()) + 1):
        of = rows.take == number
        fitted = x[of] @ np.linalg.lstsq(x[of], left[of], rcond=None)[0]
        explained += float(fitted @ fitted)
    return explained / len(left)


def _summed_up(
    boxes: dict[str, _Boxes], prepared: PreparedTakes, seed: int, limits: CeilingLimits
) -> Ceiling:
    rotations = {
        name: Gain.of(item.saved, item.mean_square, item.offline_square, seed) for name, item in boxes.items()
    }
    saved = np.mean([item.saved for item in boxes.values()], axis=0)
    live, offline = (
        float(np.mean([getattr(item, name) for item in boxes.values()]))
        for name in ("mean_square", "offline_square")
    )
    overall = Gain.of(saved, live, offline, seed)
    verdict = verdict_of(overall, rotations, limits)
    worst = max(boxes, key=lambda name: boxes[name].by_take_share)
    changing = boxes[worst].by_take_share
    if verdict == "none" and changing > limits.most_by_take:
        why = (
            f"{100 * changing:.0f} % of the squared error of {worst} changes from take to take, and"
            f" {len(prepared.takes)} takes are too few to tell with what"
        )
        return Ceiling("undecided", overall, rotations, {}, (), len(prepared.takes), why, limits)
    gaining = [name for name, gain in rotations.items() if is_gain(gain, limits, len(rotations))]
    groups = {}
    if verdict == "gain":
        of = [boxes[name] for name in gaining or boxes]
        rise = {name: float(np.mean([item.groups[name] for item in of])) for name in GROUPS}
        ranked = sorted(GROUPS, key=lambda name: -rise[name])
        groups = {name: float(np.sqrt(rise[name])) for name in ranked if rise[name] > 0}
    return Ceiling(verdict, overall, rotations, groups, (), len(prepared.takes), None, limits)


def _unrecorded(takes: Sequence[Take], own: Sequence[Effect]) -> tuple[str, ...]:
    """Columns that effects ask for, the user's ``own`` too, and that no take has."""
    recorded = {name for take in takes for name in take.context}
    asked = dict.fromkeys(column for effect in (*catalogue().values(), *own) for column in effect.context)
    return tuple(name for name in asked if name not in recorded)


def _undecided(why: str, takes: int, limits: CeilingLimits) -> Ceiling:
    return Ceiling("undecided", None, takes=takes, obstacle=why, limits=limits)


def _measured(takes: Sequence[Take], model: CalibrationModel) -> list[Take]:
    names = trained_rotations(model)
    return [take for take in takes if np.isfinite(take.reference_at_frames(names)).any()]


def _is_of_single_poses(take: Take) -> bool:
    return len(take.time_s) < 3 or float(np.median(np.diff(take.time_s))) > SINGLE_POSES_S


def _own_sensors(prepared: PreparedTakes, rotation: str) -> tuple[int, ...]:
    """Those with a long history: the one that measures the rotation, else those it is read from."""
    item = prepared.layout.correspondence(rotation)
    measuring = item.measuring_sensor
    names = item.sensors[:MOST_OWN_SENSORS] if measuring is None else (measuring,)
    return tuple(prepared.layout.sensors.index(name) for name in names)


# What the black box is asked of one rotation: rows of recorded columns, and the errors beside them.


@dataclass(frozen=True)
class RotationRows:
    """Of one rotation, all takes after one another; only rows where it was measured."""

    groups: dict[str, np.ndarray]
    others: dict[str, np.ndarray]
    """The same columns with the rows of other takes."""
    symmetric: np.ndarray
    target: np.ndarray
    take: np.ndarray
    mean_square: float
    """Of the error at the frames, not smoothed."""
    own: tuple[int, ...]

    @classmethod
    def of(
        cls, columns: Sequence[TakeColumns], prepared: PreparedTakes, errors: Sequence[np.ndarray],
        order: Sequence[int], own: tuple[int, ...],
    ) -> RotationRows | None:  # fmt: skip
        smooth = [
            smoothed_error(item.time_s, take, error)
            for item, take, error in zip(columns, prepared.takes, errors, strict=True)
        ]
        measured = sum(int(np.isfinite(values).sum()) for values in smooth)
        step = max(ROW_EVERY, -(-measured // MOST_ROWS))
        index = [np.flatnonzero(np.isfinite(values))[::step] for values in smooth]
        if min(len(rows) for rows in index) == 0:
            return None
        swapped = {name: exchanged([item.groups[name] for item in columns], order) for name in GROUPS}

        def stacked(parts: Sequence[np.ndarray]) -> np.ndarray:
            return np.concatenate([values[rows] for values, rows in zip(parts, index, strict=True)])

        every = np.concatenate(errors)
        return cls(
            {name: stacked([item.groups[name] for item in columns]) for name in GROUPS},
            {name: stacked(swapped[name]) for name in GROUPS},
            stacked([item.symmetric_history for item in columns]),
            stacked(smooth),
            np.concatenate([np.full(len(rows), number) for number, rows in enumerate(index)]),
            float(np.nanmean(every**2)),
            own,
        )


def products_of(rows: RotationRows) -> tuple[list[tuple[int, ...]], list[tuple[int, ...]]]:
    """Places of columns to be multiplied: powers of the own readings, which know no past; and these with the
    products of a reading and its running averages, a memory that depends on the bend."""
    sensors = rows.groups["readings"].shape[1]
    averages = own_averages(rows.own, sensors)
    powers = [(sensor,) * power for sensor in rows.own for power in (2, 3)]
    remembered = [
        (*(sensor,) * power, sensors + place)
        for sensor, places in averages.items()
        for place in places
        for power in (1, 2)
    ]
    return powers, [*powers, *remembered]


def joined(groups: Mapping[str, np.ndarray]) -> np.ndarray:
    """Side by side, readings first."""
    return np.column_stack(list(groups.values()))
