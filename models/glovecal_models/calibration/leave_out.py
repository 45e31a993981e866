"""Some takes left out, a calibration with its effects fitted on the others: its errors on those left out.

One engine for all who ask: ``measured_without``. Masks over takes (``folds.py``) say what is left out: takes,
wearings, or pieces of takes. Whether a part without which no model can be trained is passed over or ends the
question is each one's own choice. Fits without different takes know nothing of each other, and are made side
by side.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np

from glovecal_models.calibration.added_effect import EffectRequest
from glovecal_models.calibration.effect_correction import EffectCorrection
from glovecal_models.calibration.effect_fit import (
    EffectFit,
    Optima,
    correspondence_for,
    fit_with_effects,
)
from glovecal_models.calibration.folds import (
    alone_in_their_motion,
    are_short,
    first_measured,
    folds_over_takes,
    pieces,
    wearing_groups,
)
from glovecal_models.calibration.learned_lead import offline_errors_of, with_leads
from glovecal_models.calibration.prepared_takes import OwnSignal, PreparedTakes
from glovecal_models.calibration.training_settings import TrainingSettings, left_out_settings
from glovecal_models.calibration.unseen_wearing import LeftOutWearing
from glovecal_models.errors import NotTrainable
from glovecal_models.progress import Cancel, Report
from glovecal_models.worker_processes import side_by_side

Measured = TypeVar("Measured")


@dataclass(frozen=True)
class HeldOutErrors:
    """Squared errors of some rotations, summed over frames."""

    square: dict[str, float]
    """Degrees squared."""
    count: dict[str, int]

    def rmse_deg(self, rotation: str) -> float:
        return float(np.sqrt(self.square[rotation] / max(self.count[rotation], 1)))

    def with_those_of(self, other: HeldOutErrors) -> HeldOutErrors:
        """These, replaced by the other's where it has any."""
        return HeldOutErrors(self.square | other.square, self.count | other.count)

    def of(self, rotations: Sequence[str]) -> HeldOutErrors:
        """Those of some rotations."""
        return HeldOutErrors(
            {name: self.square[name] for name in rotations}, {name: self.count[name] for name in rotations}
        )

    @property
    def overall_deg(self) -> float:
        """RMSE over all rotations and frames."""
        return float(np.sqrt(sum(self.square.values()) / max(sum(self.count.values()), 1)))


class TakeErrors(NamedTuple):
    """For each take (N, R), predicted minus measured, degrees; NaN where nothing was measured."""

    live: list[np.ndarray]
    offline: list[np.ndarray]
    """With both directions of time."""


class FitWithout(NamedTuple):
    """A fit of some rotations, and the takes that it has not seen."""

    fit: EffectFit
    kept: PreparedTakes
    left: PreparedTakes
    rotations: Sequence[str]
    settings: TrainingSettings


def measured_without(
    measure: Callable[[FitWithout], Measured],
    takes: PreparedTakes,
    masks: Sequence[np.ndarray],
    rotations: Sequence[str],
    wanted: Sequence[EffectRequest],
    settings: TrainingSettings,
    *,
    optima: Optima = (),
    is_optional: bool = True,
    before_each: Callable[[int], None] | None = None,
    cancelled: Cancel | None = None,
) -> Iterator[tuple[int, Measured]]:
    """For each of ``masks`` (T,), in their order, its number and ``measure`` of a fit without its takes.
    Raises Cancelled, WorkerDied.

    ``measure`` can be imported, or is a ``partial``. ``optima`` of the fit on all takes, where it is known
    (``fit_with_effects``). ``is_optional``: what cannot carry a model without a mask's takes says nothing
    about the error and is passed over; else NotTrainable is raised.
    """
    recipe = takes, tuple(rotations), tuple(wanted), settings, optima
    results = side_by_side(partial(_measured, measure, recipe, is_optional), masks, cancelled)
    for number in range(len(masks)):
        if before_each:
            before_each(number)
        measured = next(results)
        if measured is not None:
            yield number, measured


def _measured(
    measure: Callable[[FitWithout], Measured],
    recipe: tuple[PreparedTakes, Sequence[str], Sequence[EffectRequest], TrainingSettings, Optima],
    is_optional: bool,
    held: np.ndarray,
    cancelled: Cancel | None,
) -> Measured | None:
    takes, rotations, wanted, settings, optima = recipe
    kept, left = (takes.some(np.flatnonzero(mask).tolist()) for mask in (~held, held))
    try:
        fit = fit_with_effects(kept, rotations, wanted, settings, optima=optima, cancelled=cancelled)
    except NotTrainable:
        if not is_optional:
            raise
        return None
    return measure(FitWithout(fit, kept, left, rotations, settings))


def held_out_errors(
    takes: PreparedTakes,
    rotations: Sequence[str],
    wanted: Sequence[EffectRequest],
    settings: TrainingSettings,
    *,
    optima: Optima = (),
    most_square: float = np.inf,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> HeldOutErrors:
    """Leave out whole takes, in ``settings.folds`` folds, at least two. Raises NotTrainable, Cancelled.

    ``optima`` of the fit on all takes, where it is known (``fit_with_effects``). Once squared errors exceed
    ``most_square``, degrees squared over all rotations, the other folds are not fitted.

    A single take, and short takes of one motion each, are left out in pieces; so is a take that is alone in
    its motion, each piece with what came before it as its pre-roll.
    """
    square, count = dict.fromkeys(rotations, 0.0), dict.fromkeys(rotations, 0)
    short = len(takes.takes) == 1 or are_short(
        [
            take.time_s[first_measured(known) :]
            for take, known in zip(takes.takes, takes.reference, strict=True)
        ]
    )
    number = np.arange(len(takes.takes))
    parts, folds = takes, [fold.held_out for fold in folds_over_takes(number, max(settings.folds, 2))]
    alone = alone_in_their_motion([take.name for take in takes.takes], [take.wearing for take in takes.takes])
    if short:
        parts, _, place = _cut(takes, [True] * len(number))
        folds = [place == at for at in np.unique(place)]
    elif any(alone):
        parts, owner, place = _cut(takes, alone, with_history=True)
        folds = [
            np.where(np.array(alone)[owner], place % len(folds) == at, held[owner])
            for at, held in enumerate(folds)
        ]

    def before_each(at: int) -> None:
        if report:
            so_far = np.sqrt(sum(square.values()) / max(sum(count.values()), 1))
            told = f", error so far {so_far:.2f} degrees" if at else ""
            report(f"leaving out part {at + 1} of {len(folds)}{told}", at / len(folds))

    for _, summed in measured_without(
        _summed_errors, parts, folds, rotations, wanted, settings,
        optima=optima, before_each=before_each, cancelled=cancelled,
    ):  # fmt: skip
        for name in rotations:
            square[name] += summed.square[name]
            count[name] += summed.count[name]
        if sum(square.values()) > most_square:
            break
    return HeldOutErrors(square, count)


def _summed_errors(of: FitWithout) -> HeldOutErrors:
    errors = errors_of(of.fit, of.left, of.rotations, of.settings)
    square = {name: float(each @ each) for name, each in errors.items()}
    return HeldOutErrors(square, {name: len(each) for name, each in errors.items()})


def held_out_take_errors(
    takes: PreparedTakes,
    rotations: Sequence[str],
    wanted: Sequence[EffectRequest],
    settings: TrainingSettings,
    *,
    folds: int,
    optima: Optima = (),
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> TakeErrors:
    """Whole takes are left out in so many ``folds``. ``optima`` as in ``measured_without``. Raises
    NotTrainable, Cancelled.
    """
    count = len(takes.takes)
    parts = folds_over_takes(np.arange(count), folds)
    found = TakeErrors([np.empty((0, 0))] * count, [np.empty((0, 0))] * count)

    def before_each(at: int) -> None:
        if report:
            report(f"leaving out {parts[at].sentence}", at / len(parts))

    for number, of in measured_without(
        _take_errors, takes, [part.held_out for part in parts], rotations, wanted, settings,
        optima=optima, is_optional=False, before_each=before_each, cancelled=cancelled,
    ):  # fmt: skip
        for errors, mine in zip(found, of, strict=True):
            for at, part in zip(np.flatnonzero(parts[number].held_out).tolist(), mine, strict=True):
                errors[at] = part
    return found


def _take_errors(of: FitWithout) -> TakeErrors:
    of = of._replace(fit=with_leads(of.fit, of.kept, of.settings))
    own = of.fit, of.left, of.rotations, of.settings
    return TakeErrors(frame_errors_of(*own), offline_errors_of(*own))


def errors_of(
    fit: EffectFit, takes: PreparedTakes, rotations: Sequence[str], settings: TrainingSettings
) -> dict[str, np.ndarray]:
    """For each rotation the errors (predicted minus measured) of all measured frames, degrees."""
    errors = np.concatenate(frame_errors_of(fit, takes, rotations, settings))
    return {name: part[np.isfinite(part)] for name, part in zip(rotations, errors.T, strict=True)}


def frame_errors_of(
    fit: EffectFit, takes: PreparedTakes, rotations: Sequence[str], settings: TrainingSettings
) -> list[np.ndarray]:
    """For each take (N, R), predicted minus measured, degrees; NaN where nothing was measured."""
    base = {
        name: OwnSignal.of(takes, correspondence_for(takes, name, settings), fit.regressor(name)).takes
        for name in rotations
    }
    correction = EffectCorrection(fit.effects, list(rotations), takes.scale)
    targets = {name: takes.target(name) for name in rotations}
    found = []
    for number, take in enumerate(takes.takes):
        mean = np.column_stack([base[name][number] for name in rotations])
        readings = takes.readings[number]
        mean += correction.of_take(take.time_s, mean, readings, take.context, take.wearing).degrees
        found.append(mean - np.column_stack([targets[name][number] for name in rotations]))
    return found


def _cut(
    takes: PreparedTakes, in_pieces: Sequence[bool], *, with_history: bool = False
) -> tuple[PreparedTakes, np.ndarray, np.ndarray]:
    """Takes in pieces as takes of their own, others whole; each one's take and its number within that.

    ``with_history``: before what is measured of a piece stand the readings of the take up to there, so that
    effects with a memory are where they were.
    """
    found, reference, owner, place = [], [], [], []
    for index, (take, measured) in enumerate(zip(takes.takes, takes.reference, strict=True)):
        parts = pieces(take.time_s, measured) if in_pieces[index] else [slice(0, len(take.time_s))]
        deviations = take.reference_sd_at_frames(takes.layout.rotations)
        for number, known in enumerate(part for part in parts if part.stop > part.start):
            rows = slice(0, known.stop) if with_history else known
            owner.append(index)
            place.append(number)
            before = np.full((known.start - rows.start, measured.shape[1]), np.nan)
            reference.append(np.concatenate([before, measured[known]]))
            found.append(
                replace(
                    take,
                    name=f"{take.name}, part {number + 1}" if len(parts) > 1 else take.name,
                    time_s=take.time_s[rows],
                    readings=take.readings[rows],
                    rotations=takes.layout.rotations,
                    reference_time_s=take.time_s[known],
                    reference=measured[known],
                    reference_sd=None if deviations is None else deviations[known],
                    context={name: values[rows] for name, values in take.context.items()},
                    poses=None if take.poses is None else take.poses[rows],
                )
            )
    prepared = PreparedTakes.of(found, takes.layout)
    in_parts = replace(prepared, reference=tuple(reference), scale=takes.scale)
    return in_parts, np.array(owner), np.array(place)


def left_out_wearings(
    takes: PreparedTakes,
    rotations: Sequence[str],
    wanted: Sequence[EffectRequest],
    settings: TrainingSettings,
    *,
    optima: Optima = (),
    cancelled: Cancel | None = None,
) -> Iterator[LeftOutWearing]:
    """None with a single wearing. ``optima`` as in ``held_out_errors``. Workers begin when this is called and
    go on beside other work; without any, wearings are left out when they are asked for. Raises Cancelled,
    WorkerDied."""
    wearings = [take.wearing for take in takes.takes]
    groups = wearing_groups(wearings)
    masks = [np.array([name in group for name in wearings]) for group in groups]
    recipe = takes, tuple(rotations), tuple(wanted), left_out_settings(settings), optima
    work = partial(_measured, _left_out_wearings, recipe, True)
    found = side_by_side(work, masks, cancelled, at_once=True)
    return (item for of_group in found for item in of_group or ())


def _left_out_wearings(of: FitWithout) -> list[LeftOutWearing]:
    wearings = [take.wearing for take in of.left.takes]
    trained = len({take.wearing for take in of.kept.takes})
    return [
        item
        for wearing in dict.fromkeys(wearings)
        for item in _left_out(
            of.fit, of.left.some([at for at, name in enumerate(wearings) if name == wearing]),
            of.rotations, of.settings, wearing, trained,
        )
    ]  # fmt: skip


def _left_out(
    fit: EffectFit,
    takes: PreparedTakes,
    rotations: Sequence[str],
    settings: TrainingSettings,
    wearing: str,
    trained: int,
) -> list[LeftOutWearing]:
    errors, found = errors_of(fit, takes, rotations, settings), []
    for name in rotations:
        regressor, each = fit.regressor(name), takes.inputs(correspondence_for(takes, name, settings))
        variance = np.concatenate(
            [
                regressor.predict(part[np.isfinite(target)]).variance
                for part, target in zip(each, takes.target(name), strict=True)
                if np.isfinite(target).any()
            ]
            or [np.empty(0)]
        )
        if len(variance):
            noise = float(regressor.noise_variance)
            square, claimed = float(errors[name] @ errors[name]), float(variance.mean()) + noise
            found.append(LeftOutWearing(name, wearing, trained, square, len(errors[name]), claimed, noise))
    return found
