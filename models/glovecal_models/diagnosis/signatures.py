"""Effects known by a signature in the recording, asked in the order in which they mislead others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.calibration.effect_correction import SignalScale
from glovecal_models.calibration.folds import held_levels
from glovecal_models.calibration.held_out import BaseProducts, Rows
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.naming import Naming, saved_share_of
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.effect import (
    CorrectionEffect,
    Effect,
    IntervalEffect,
    RepairEffect,
    SignatureEffect,
    Weighed,
    is_asked_last,
)
from glovecal_models.effects.base.findings import Finding, FoundBefore, frames_inside
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.catalogue import relations
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

LABELS = (0.0, 1.0)
"""Of a reference that names poses and measures no angle: 1 for a fist, 0 for a flat hand."""
FEWEST_MEASURED = 50
"""Measured frames of a joint; fewer tell no curve."""


def may_explain(
    effect: Effect,
    naming: Naming,
    found: Sequence[Finding],
    effects: Mapping[str, Effect],
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS,
) -> bool:
    """Whether what an effect that is asked for last found is behind a ranking: nothing is ranked, or only
    effects that seem to explain a part of it, and not in equal steps of a column. These explain no more than
    that, or they are not needed beside what was found where that is larger. ``effects``: those that were
    ranked, by name."""
    if not is_asked_beside(effect, naming, effects):
        return False
    if not naming.ranked:
        return True
    first = naming.ranked[0]
    if first.steps is None and saved_share_of(first) < relations().whole(effect.name).share:
        return _size_square(found) >= limits.whole_least_share * first.saved_square
    needless = [set(item.accounts_for) for item in found]
    if all(item.effect in set.intersection(*needless) for item in naming.ranked):
        return True
    is_larger = _size_square(found) > first.saved_square
    return all(item.effect in set.union(*needless) for item in naming.ranked) and is_larger


def _size_square(found: Sequence[Finding]) -> float:
    """Degrees squared, summed over where something was found; nothing for what has no size."""
    return sum(
        item.size_deg**2 if item.error_square is None else item.error_square
        for item in found
        if item.size_deg is not None
    )


def is_asked_beside(effect: Effect, naming: Naming, effects: Mapping[str, Effect]) -> bool:
    """Whether an effect that is asked for last may be behind a ranking: all of it seems to explain a part of
    the effect. A column that goes along is no cause by itself, whatever its name."""
    parts = relations().whole(effect.name).parts
    return all(item.effect in parts or not effects[item.effect].about.is_physical for item in naming.ranked)


def is_outweighed(
    found: Sequence[Finding], naming: Naming, limits: DiagnosisLimits = DIAGNOSIS_LIMITS
) -> bool:
    """Whether the first of a ranking explains far more error than there is where something was found."""
    squares = [item.error_square for item in found]
    if not naming.ranked or any(square is None for square in squares):
        return False
    there = sum(square for square in squares if square is not None)
    return naming.ranked[0].saved_square > limits.outweighed_times * there


def asked_first(effects: Sequence[Effect]) -> list[SignatureEffect]:
    """Effects asked for by their signature before anything else is judged, because they would mislead the
    others: repairs first, each kind by name."""
    every = [item for item in effects if isinstance(item, SignatureEffect) and item.comparison is None]
    found = [item for item in every if not is_asked_last(item)]
    return sorted(found, key=lambda item: (not isinstance(item, RepairEffect), item.name))


def asked_last(effects: Sequence[Effect]) -> list[IntervalEffect]:
    """Effects asked for by their signature once nothing that was compared explains the error, by name."""
    found = [item for item in effects if isinstance(item, IntervalEffect) and is_asked_last(item)]
    return sorted(found, key=lambda item: item.name)


def own_sensors(layout: Layout, joints: Sequence[str]) -> dict[str, str]:
    """The measuring sensor of each joint that has one."""
    found = {name: layout.correspondence(name).measuring_sensor for name in joints}
    return {name: sensor for name, sensor in found.items() if sensor is not None}


def weighed(
    effect: Effect,
    ranked: Assessment | None,
    takes: Sequence[Take],
    layout: Layout,
    by_name: Mapping[str, Effect],
    known: Sequence[KnownEffect] = (),
) -> Weighed | None:
    """An effect that may be hidden against one of a ranking; None where there is none, or it has no sensors
    of its own, or the two are not taken for each other. The others as for ``signature_findings``."""
    if ranked is None or not isinstance(effect, IntervalEffect) or effect.hidden is None:
        return None
    cause = by_name[ranked.effect]
    if not isinstance(cause, CorrectionEffect):
        return None
    sensor_of = own_sensors(layout, [ranked.joints[i] for i in ranked.significant_joints])
    if not sensor_of:
        return None
    return effect.hidden.weighed_against(cause, takes, sensor_of, static_errors(takes, sensor_of, known))


def signature_findings(
    takes: Sequence[Take],
    layout: Layout,
    joints: Sequence[str],
    naming: Naming,
    effects: Sequence[Effect],
    by_name: Mapping[str, Effect],
    known: Sequence[KnownEffect] = (),
    found_before: FoundBefore | None = None,
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS,
) -> Iterator[Finding]:
    """Largest first within each effect of ``effects``, those that the model does not have; ``known`` are
    those that it has, ``by_name`` all that were ranked."""
    found_before = found_before or FoundBefore()
    sensor_of = own_sensors(layout, joints)
    if not sensor_of:
        return
    first = asked_first(effects)
    if are_held_levels(takes):
        for item in first:
            if isinstance(item, RepairEffect):
                yield from item.between_levels(takes, sensor_of)
        return
    for item in first:
        found = found_before.find(item, takes, sensor_of)
        if naming.ranked and any(each.stretches for each in found):
            found = _with_error_squares(found, takes, sensor_of, static_errors(takes, sensor_of, known))
        yield from found
    for item in asked_last(effects):
        if is_asked_beside(item, naming, by_name):
            found = item.find(takes, sensor_of, static_errors(takes, sensor_of, known))
            if found and may_explain(item, naming, found, by_name, limits):
                against = weighed(item, naming.first, takes, layout, by_name, known)
                if against is None or against.is_instead is not False:
                    yield from found


def are_pose_labels(takes: Sequence[Take]) -> bool:
    """Whether all reference values of all takes are 0 or 1, both occur, and each lasts."""
    found: set[float] = set()
    for take in takes:
        values = take.reference[np.isfinite(take.reference)]
        if not np.isin(values, LABELS).all():
            return False
        found.update(label for label in LABELS if (values == label).any())
    return found == set(LABELS)


def are_held_levels(takes: Sequence[Take]) -> bool:
    """Whether all takes only hold one angle after another: there nothing moves, and repeats mean nothing."""
    return bool(takes) and all(held_levels(take.reference) is not None for take in takes)


def _with_error_squares(
    found: Sequence[Finding],
    takes: Sequence[Take],
    sensor_of: Mapping[str, str],
    errors: Sequence[np.ndarray],
) -> list[Finding]:
    """Each finding with the squared error of its sensors' rotations in its stretches."""
    result = []
    for item in found:
        columns = [place for place, sensor in enumerate(sensor_of.values()) if sensor in item.where]
        inside = [frames_inside(take, item.stretches)[:, None] for take in takes]
        squares = [
            np.where(mask, part[:, columns] ** 2, 0.0) for mask, part in zip(inside, errors, strict=True)
        ]
        count = sum(int(np.isfinite(part[:, columns]).any(axis=1).sum()) for part in errors)
        known = item.stretches and columns and count
        total = sum(float(np.nansum(part)) for part in squares)
        result.append(replace(item, error_square=total / count) if known else item)
    return result


def static_errors(
    takes: Sequence[Take], sensor_of: Mapping[str, str], known: Sequence[KnownEffect] = ()
) -> list[np.ndarray]:
    """For each take (N, joints), degrees: what a smooth curve of each joint's own sensor leaves.

    ``known``: effects that a model has already; they are fitted beside the curve, so that what they explain
    is not asked about again.
    """
    result = [np.full((len(take.time_s), len(sensor_of)), np.nan) for take in takes]
    others = _others(takes) if known else [{} for _ in takes]
    for column, (rotation, sensor) in enumerate(sensor_of.items()):
        x = [take.readings[:, take.sensors.index(sensor)] for take in takes]
        y = [take.reference_at_frames([rotation])[:, 0] for take in takes]
        rows = [np.flatnonzero(np.isfinite(part)) for part in y]
        every = np.concatenate(x)
        measured = np.concatenate([part[index] for part, index in zip(x, rows, strict=True)])
        if len(measured) < FEWEST_MEASURED or np.ptp(measured) == 0:
            continue
        low, span = float(every.min()), max(float(np.ptp(every)), 1e-9)
        curves = [np.polynomial.legendre.legvander(2 * (part - low) / span - 1, 7) for part in x]
        here = [item for item in known if rotation in item.joints]
        columns, fitted = curves, _fitted(curves, y, rows)
        if here:
            signals = [
                Signals(
                    take.time_s, (part @ fitted.whole)[:, None], other, take.context, take.wearing, take.name
                )
                for take, part, other in zip(takes, curves, others, strict=True)
            ]
            extra = [found for item in here if (found := item.columns(signals, 0, rotation)) is not None]
            columns = [
                np.column_stack([part, *(found.parts[number] for found in extra)])
                for number, part in enumerate(curves)
            ]
            free = np.full(curves[0].shape[1], np.inf)
            prior_sd = np.concatenate([free, *(found.prior_sd for found in extra)])
            fitted = _fitted(columns, y, rows, prior_sd, len(free))
        for part, found, angle in zip(result, columns, y, strict=True):
            part[:, column] = found @ fitted.whole - angle
    return result


def _others(takes: Sequence[Take]) -> list[dict[str, np.ndarray]]:
    """Each sensor in standard deviations over all takes."""
    sensors = takes[0].sensors
    readings = [take.readings[:, [take.sensors.index(name) for name in sensors]] for take in takes]
    every = np.concatenate(readings)
    scale = SignalScale(sensors, every.mean(axis=0), every.std(axis=0))
    return [scale.others(part) for part in readings]


def _fitted(
    columns: Sequence[np.ndarray],
    target: Sequence[np.ndarray],
    rows: Sequence[np.ndarray],
    prior_sd: np.ndarray | None = None,
    own: int | None = None,
) -> BaseProducts:
    units = zip(columns, target, rows, strict=True)
    return BaseProducts([Rows(part[index], angle[index]) for part, angle, index in units], prior_sd, own)
