"""Effects known by a signature in the recording, asked in the order in which they mislead others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.calibration.folds import held_levels
from glovecal_models.diagnosis.naming import Naming
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.facts import Stage
from glovecal_models.effects.base.signature_effect import Finding, SignatureEffect
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take


def may_explain(effect: Effect, naming: Naming) -> bool:
    """Whether an effect that is asked for last may be behind a ranking: nothing is ranked, or only effects
    that seem to explain a part of it, and explain no more than that."""
    if not naming.ranked:
        return True
    first = naming.ranked[0]
    share = np.mean([first.errors[joint].contrast for joint in first.significant_joints])
    only = all(item.effect in effect.also_explained_by for item in naming.ranked)
    return only and bool(share < effect.also_explained_share)


def by_signature(effects: Sequence[Effect], stage: Stage) -> list[SignatureEffect]:
    """Effects asked for by their signature at a stage: repairs first, each kind by name."""
    found = [item for item in effects if isinstance(item, SignatureEffect) and item.stage == stage]
    return sorted(found, key=lambda item: (item.kind != "repair", item.name))


def own_sensors(layout: Layout, joints: Sequence[str]) -> dict[str, str]:
    """The measuring sensor of each joint that has one."""
    found = {name: layout.correspondence(name).measuring_sensor for name in joints}
    return {name: sensor for name, sensor in found.items() if sensor is not None}


def signature_findings(
    takes: Sequence[Take],
    layout: Layout,
    joints: Sequence[str],
    naming: Naming,
    assessments: Sequence[Assessment],
    effects: Sequence[Effect],
) -> Iterator[Finding]:
    """Largest first within each effect of ``effects``, those that the model does not have."""
    sensor_of = own_sensors(layout, joints)
    if not sensor_of:
        return
    first = by_signature(effects, "first")
    if are_held_levels(takes):
        for item in first:
            yield from item.find_between_levels(takes, sensor_of)
        return
    for item in first:
        yield from item.find(takes, sensor_of)
    for item in by_signature(effects, "last"):
        if may_explain(item, naming):
            plausible = _with_plausible_context(takes, assessments, effects)
            yield from item.find(plausible, sensor_of, static_errors(takes, sensor_of))


def are_held_levels(takes: Sequence[Take]) -> bool:
    """Whether all takes only hold one angle after another: there nothing moves, and repeats mean nothing."""
    return bool(takes) and all(held_levels(take.reference) is not None for take in takes)


def beside_levels(
    naming: Naming, takes: Sequence[Take], findings: Sequence[Finding], effects: Mapping[str, Effect]
) -> Naming:
    """One pass over known angles cannot tell what is found between them from some effects: both are named."""
    if not findings or not are_held_levels(takes):
        return naming
    found = effects[findings[0].effect]
    if not naming.ranked:
        return replace(naming, confidence_set=(found.name, *found.alike_between_levels))
    if naming.ranked[0].effect not in found.alike_between_levels:
        return naming
    return replace(naming, confidence_set=(*naming.confidence_set, found.name))


def _with_plausible_context(
    takes: Sequence[Take], assessments: Sequence[Assessment], effects: Sequence[Effect]
) -> list[Take]:
    """Without the context columns that save too little: takes are few, and each column uses one up."""
    context = {item.name: item.context for item in effects}
    saving = [
        item
        for item in assessments
        if max(e.contrast for e in item.errors) >= item.limits.least_session_share
    ]
    kept = {name for item in saving for name in context.get(item.effect, ())}
    return [
        replace(take, context={name: values for name, values in take.context.items() if name in kept})
        for take in takes
    ]


def static_errors(takes: Sequence[Take], sensor_of: dict[str, str]) -> list[np.ndarray]:
    """For each take (N, joints): what a smooth curve of each joint's own sensor leaves, degrees."""
    result = [np.full((len(take.time_s), len(sensor_of)), np.nan) for take in takes]
    for column, (rotation, sensor) in enumerate(sensor_of.items()):
        x = [take.readings[:, take.sensors.index(sensor)] for take in takes]
        y = [take.reference_at_frames([rotation])[:, 0] for take in takes]
        every, target = np.concatenate(x), np.concatenate(y)
        known = np.isfinite(target)
        if known.sum() < 50 or np.ptp(every[known]) == 0:
            continue
        low, span = float(every.min()), max(float(np.ptp(every)), 1e-9)
        columns = np.polynomial.legendre.legvander(2 * (every[known] - low) / span - 1, 7)
        curve = np.linalg.lstsq(columns, target[known], rcond=None)[0]
        for part, reading, angle in zip(result, x, y, strict=True):
            part[:, column] = np.polynomial.legendre.legval(2 * (reading - low) / span - 1, curve) - angle
    return result
